"""What the guest of the SocketCAN test cannot see is refused before it boots."""

from pathlib import Path

from tests.hil.bus.guest import COVERED, covered


def test_a_checkout_under_a_mount_of_the_guest_is_refused_at_once() -> None:
    for folder in COVERED:
        assert covered([Path("/srv/checkout"), Path(folder) / "checkout"]).endswith(f"covers; got {folder}/checkout")
    assert covered([Path("/srv/checkout"), Path("/home/somebody/tmp")]) == ""
