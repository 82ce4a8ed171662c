"""Material of FMUs: slaves, documentation and licences that the export copies into them."""
