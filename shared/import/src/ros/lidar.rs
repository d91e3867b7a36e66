//! The sweeps of a bag: one file per cloud, or a capture of the packets.

mod capture;
mod sweeps;

pub(crate) use capture::Capture;
pub(crate) use sweeps::{FieldNames, FinishedSweeps, Sweeps};
