//! Flash that the driver takes of a Cortex-M4F.

use driver_footprint::driver_bytes;

/// The limits are the sizes measured when the test was written, and a tenth.
#[test]
fn the_driver_takes_at_most_a_tenth_more_flash_than_when_it_was_measured() {
    for (features, limit) in [("burst", 6_600), ("everything", 21_100), ("asynchronous", 31_300)] {
        let bytes = driver_bytes(features);
        println!("{features}: {bytes} bytes");
        assert!(bytes <= limit, "{features}: {bytes} bytes of flash, more than {limit}");
    }
}
