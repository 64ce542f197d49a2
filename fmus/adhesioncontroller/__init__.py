"""Controller that keeps the creep of a driven wheelset at the peak of adhesion."""
