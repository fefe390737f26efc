"""Constants of motion by elliptic functions: fields of a flight."""

from __future__ import annotations

from vibro_cli.compile.kernel import struct


@struct
class ThetaConstants:
    """What the theta series of one parameter need (fields of a flight)."""

    parameter: float  # m
    root_complement: float  # sign(1 - m) sqrt|1 - m|
    form: int  # TRIGONOMETRIC, HYPERBOLIC, HYPERBOLIC_TINY
    reciprocal: int  # 1: m > 1, so cn and dn change places
    argument_scale: float  # z = u scale (trigonometric), z = u + u scale (hyperbolic)
    even_0: float
    even_2: float
    even_4: float
    odd_1: float
    odd_3: float
    sum_0: float
    sum_2: float
    difference_1: float
    difference_3: float
    sine_scale: float
    cosine_scale: float
    delta_scale: float
    two_nome: float
    root_nome: float  # square root of the complementary nome (hyperbolic)
    half_period: float  # -ln(complementary nome), high part
    half_period_low: float  # and low part


@struct
class QuarticConstants(ThetaConstants):
    """What the motion under one quartic needs (fields of a flight)."""

    quartic_0: float  # a0
    quartic_1: float  # a1
    quartic_2: float  # a2
    quartic_3: float  # a3
    start_rate: float  # u' at the start: its square is a4
    lattice: int  # RECTANGULAR or RHOMBIC
    turns_over: int  # 1: u passes infinity
    root: float  # z of the greatest real root (rectangular), of the real one (rhombic)
    second: float  # e1 - e2; rhombic: real part of e1 - e2
    third: float  # e1 - e3; rhombic: imaginary part of e1 - e2
    rate_scale: float  # argument of the theta functions for one unit of time
    back: float  # u'^2 z where it comes back to the start
    returns_early: int  # 1: it does so within half a period
