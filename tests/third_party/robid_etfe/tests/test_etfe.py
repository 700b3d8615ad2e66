from robid_etfe import Etfe

from robid_core.testing import check_stage


def test_etfe_keeps_the_contract() -> None:
    check_stage(Etfe, discard=1)
