//! The driver's share of the flash of a Cortex-M4F.

use driver_footprint::driver_bytes;

/// What it took when this was written, and a tenth: if it grows beyond, somebody should look.
#[test]
fn the_driver_is_small() {
    for (features, limit) in [("burst", 6_000), ("everything", 21_100), ("asynchronous", 31_300)] {
        let bytes = driver_bytes(features);
        println!("{features}: {bytes} bytes");
        assert!(bytes <= limit, "{features}: {bytes} bytes of flash, more than {limit}");
    }
}
