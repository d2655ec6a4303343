//! The page in headless Chromium, with the files of other programs and the command `imunoise`. Without Chromium or Node.js the tests are
//! reported as skipped.

mod harness;
mod live;
mod same_report;
mod use_of_the_page;
