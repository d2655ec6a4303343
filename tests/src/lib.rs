//! The tests of the noise observatory as a whole live in `tests/`; this library is empty.
