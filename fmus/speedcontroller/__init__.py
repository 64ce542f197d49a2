"""Controller that holds a speed by a limited torque."""
