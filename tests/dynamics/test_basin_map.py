"""The motions that starts come to over a grid."""

import numpy as np

import jaxcrusher as jc


def test_two_designs_side_by_side():
    """A quiet one beside one of several motions: each as `coexisting_orbits` finds it alone."""
    told = []
    found = jc.basin_map(
        {"speed": [30.0, 40.0], "clearance": [0.12e-3]},
        starts=8,
        turns=400,
        progress=lambda done, of: told.append((done, of)),
    )
    assert told == [(0, 2), (1, 2), (2, 2)]
    assert found.worst_rms.dims == ("speed", "clearance")
    alone = jc.coexisting_orbits(jc.paper_scene(40.0, 0.12e-3), starts=8, turns=400)
    here = found.isel(speed=1, clearance=0)
    count = len(alone.orbits)
    assert count > 1 and found.sizes["orbit"] == count
    np.testing.assert_array_equal(here.label, alone.labels)
    np.testing.assert_array_equal(here.start_state, alone.starts)
    np.testing.assert_array_equal(here.share, alone.shares)
    np.testing.assert_array_equal(here.share_error, alone.share_errors)
    assert here.orbit_period.values.tolist() == [orbit.period for orbit in alone.orbits]
    reached = [float(one.foundation_rms) for one in alone.orbits]
    reached = [rms for rms, share in zip(reached, alone.shares, strict=True) if share > 0]
    assert float(here.worst_rms) == max(reached) > float(here.likeliest_rms) - 1e-9
    assert float(here.likeliest_rms) == reached[0]
    assert float(here.unsettled) == np.mean(alone.labels < 0)
    quiet = found.isel(speed=0, clearance=0)
    # Most swing about the one quiet motion after 400 turns; further columns are empty.
    assert quiet.share.values[0] > 0.5 and np.isnan(quiet.orbit_rms.values[count - 1])
    assert quiet.orbit_period.values[count - 1] == 0
