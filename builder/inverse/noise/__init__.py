"""What strain holds beside the pressure states, term by term: gauges, hardware as built, mesh, heat, flow."""
