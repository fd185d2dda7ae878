"""A plausible vibrating-contact gauge: 24 V from 50 Hz mains, a swing at 100 Hz of some 350 µm, volts out.

Chosen, not measured: no source prints numbers of such a gauge.
"""

from __future__ import annotations

from selector.physics.gauging.transducer import Contact, Electromagnet, Generator, Probe, Relay, Smoothing, Transducer

TRANSDUCER = Transducer(
    # 24 V effective; about half of the inductance belongs to the gap: 2 · 17 N/A² · 1.5 mm = 0.05 H
    electromagnet=Electromagnet(
        voltage_v=34.0, frequency_hz=50.0, resistance_ohm=150.0, inductance_h=0.12, force_n_per_a2=17.0, gap_m=1.5e-3
    ),
    # 105 Hz by itself; the magnet, which pulls the more the nearer it is, takes it down to 102 Hz
    probe=Probe(mass_kg=0.03, stiffness_n_per_m=13000.0, damping_ns_per_m=4.0),
    # ball of hard metal, 4 mm, on steel: 4/3 · 1.6e11 Pa · √2 mm; wet with coolant
    contact=Contact(stiffness=9.5e9, exponent=1.5, damping_s_per_m=30.0),
    generator=Generator(turns=2000.0, flux_wb=3e-5, gap_m=1e-3, time_constant_s=2e-3),
    smoothing=Smoothing(time_constant_s=0.1),
    relay=Relay(delay_s=0.01, noise_v=0.001),
    # the swing reaches 40 µm beyond the surface of a part that is to size
    rest_gap_m=170e-6,
)
