"""Compare two control laws over vehicles of unknown mass, on all cores, and save table and figure in out/campaign.

Prints:
    lpv-mpc: 0.246 m, 2 flights
    geometric-se3: 0.486 m, 2 flights
"""

import numpy as np

import colibri


def main():
    results = colibri.campaign(
        fly={"track": "lemniscate:lap=8", "duration": 5, "turbulence": "light"},
        grid={"controller": ["lpv-mpc", "geometric-se3"]},
        draw={"plant-vehicle.body.mass_kg*": {"uniform": [0.9, 1.1]}},  # the laws assume the nominal mass
        seeds=range(1, 3),
        paired=True,  # both laws get the same vehicles
    )
    results.save("out/campaign")
    results.plot("rmse_m").savefig("campaign_and_plot.png")
    for law in ("lpv-mpc", "geometric-se3"):
        errors_m = [row["rmse_m"] for row in results.flights if row["controller"] == law]
        print(f"{law}: {np.median(errors_m):.3f} m, {len(errors_m)} flights")


if __name__ == "__main__":  # the worker processes import this file
    main()
