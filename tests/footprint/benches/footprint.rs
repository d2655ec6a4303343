//! Prints the driver's cost on a Cortex-M4F: bytes of flash, and instructions per burst, counted by QEMU.

use driver_footprint::{M4F, added_bytes, build};
use std::process::Command;

fn main() {
    println!("flash of the driver alone, built as the firmware is:");
    for (features, what) in [
        ("burst", "init, burst, validation, integer values"),
        ("everything", "every method, blocking (with arithmetic of f64)"),
        ("asynchronous", "every method, async (with arithmetic of f64)"),
    ] {
        println!("{:>8} bytes  {what}", added_bytes(M4F, features));
    }
    println!("instructions:");
    let output = Command::new("qemu-system-arm")
        .args(["-M", "mps2-an386", "-nographic", "-monitor", "none", "-serial", "none", "-icount", "shift=0"])
        .args(["-semihosting-config", "enable=on,target=native", "-kernel"])
        .arg(build(M4F, "counted"))
        .output()
        .expect("qemu-system-arm starts; it is the Debian package of that name");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    for line in String::from_utf8_lossy(&output.stdout).lines() {
        let (name, count) = line.split_once(' ').expect("a name and a number");
        println!("{count:>8}        {name}");
    }
}
