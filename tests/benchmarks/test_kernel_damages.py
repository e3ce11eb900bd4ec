"""The program that damages machine code, in short."""

import kernel_damages


def test_no_damage_of_machine_code_fails_a_run_or_changes_a_number():
    found = kernel_damages.damaged_runs(4)
    assert (found["right"], found["failed"], found["wrong"]) == (4, 0, 0)
