//! What stages say to each other: one file per topic, each with the byte table of its row and header.
//!
//! A message is an [`Envelope`], a fixed header and a slice of rows, all plain `repr(C)` data that is written once into
//! shared memory and read in place. Frames, units and axes follow `docs/conventions.md`.

mod byte_table;
mod class_table;
mod columns;
mod cube;
mod envelope;
mod placement;
pub mod pod;
mod raw;
mod submap;
mod sweep;
mod tick;
mod trajectory;

pub use byte_table::{ByteField, ByteTable};
pub use class_table::{CLASS_TABLE_VERSION, ClassId, GROUND_CLASSES, class_name};
pub use columns::{
    Class, ClassHeader, ClassRow, Color, ColorHeader, ColorRow, Instance, InstanceHeader, MAX_BANDS, NO_SPECTRUM,
    Spectra, SpectraHeader, SpectraView, UNSEEN,
};
pub use cube::{Cube, CubeHeader, CubeView, MAX_CUBE_BANDS};
pub use envelope::{Envelope, Message};
pub use placement::{FRAME_EAST_NORTH_UP, FRAME_LOCAL, Placement, PlacementHeader, PlacementRow};
pub use pod::Pod;
pub use raw::{Gnss, GnssRow, Image, ImageHeader, Imu, ImuRow, Mosaic, MosaicHeader, NoHeader};
pub use submap::{
    MAX_SWEEPS_PER_SUBMAP, POINT_DYNAMIC, POINT_INCIDENCE_UNKNOWN, Submap, SubmapHeader, SubmapPoint, SubmapSweep,
};
pub use sweep::{Sweep, SweepHeader, SweepPoint};
pub use tick::{NO_DRIVE_TIME, Tick, TickRow};
pub use trajectory::{PoseRow, StampedPose, Trajectory};
