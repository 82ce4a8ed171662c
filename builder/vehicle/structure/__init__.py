"""What a vehicle file says of its structure: wall, support, frames, masses and temperature."""
