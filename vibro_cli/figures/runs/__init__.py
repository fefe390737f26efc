"""Figures of a run other than its phase portraits: scene, plan, velocities, charts."""
