//! The promises of the transport.
//!
//! Miri has no POSIX shared memory: under it, only the unit tests of the crate run.

#![cfg(not(miri))]

mod channels;
mod observers;
mod support;
