"""One-degree-of-freedom electromechanical drive."""
