//! Every test of this crate in one program, so that what it links is compiled and linked once.

#[path = "browser/main.rs"]
mod browser;
#[path = "exports/main.rs"]
mod exports;
#[path = "findings/main.rs"]
mod findings;
#[path = "rendering/fixture.rs"]
mod fixture;
#[path = "live/main.rs"]
mod live;
#[path = "rendering/main.rs"]
mod rendering;
#[path = "screen/main.rs"]
mod screen;
