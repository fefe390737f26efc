"""From scenarios to the systems that are solved: the only place that knows both."""

from vibro_cli.build.trace import build_trace as build_system

__all__ = ["build_system"]
