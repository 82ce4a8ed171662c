"""What strain holds other than the pressure states, term by term: gauges, hardware as built, mesh, heat, flow."""
