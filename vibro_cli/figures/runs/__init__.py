"""Figures of a run besides its phase portraits: scene, plan, velocities, charts."""
