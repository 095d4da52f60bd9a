"""Speed of environments: what is no other tree is refused, before anything is timed."""

from tests.tools.environment_speed import FRONTS, IN_TURNS, EnvironmentSpeed, main


def test_a_folder_without_the_package_is_refused(tmp_path, capsys):
    assert main(EnvironmentSpeed(also=tmp_path)) == 2
    assert capsys.readouterr().err.startswith(f"error: --also {tmp_path}: no folder maipp")
    assert set(IN_TURNS) < set(FRONTS)
