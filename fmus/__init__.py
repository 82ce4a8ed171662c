"""What an FMU is made of: slaves, documentation and licences that the export copies into it."""
