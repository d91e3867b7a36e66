//! A recorded drive in ticks.

mod account;
mod camera_file;
mod drive_reader;
mod events;
mod inertial;
mod odometer;
mod secondary_lidars;
mod trigger;

pub use account::{DriveAccount, News, SavedDrive};
pub use camera_file::{CameraFileError, image_into, mosaic_into};
pub use drive_reader::{
    DrivePosition, DriveReader, Due, FramesOutside, InitialCounts, NextSweep, Part, SkippedAtBegin, drive_problems,
};
pub use inertial::BadLines;
pub(crate) use odometer::Odometer;
pub use trigger::Trigger;
