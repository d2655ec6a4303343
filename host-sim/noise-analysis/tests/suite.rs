//! Every test of this crate in one program, so that what it links is compiled and linked once.

mod consistency;
mod findings;
mod first_half;
mod first_order_filter;
mod gaps;
mod hidden_beside;
mod long_record;
mod navigation;
mod odd_input;
mod one_part;
mod record_length;
mod report_figures;
mod several;
#[path = "spectra/main.rs"]
mod spectra;
