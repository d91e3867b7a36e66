//! The messages of all topics: one file per topic, each with the byte table of its row and header.
//!
//! A message is an [`Envelope`], a fixed header and a slice of rows, all plain `repr(C)` data that is written once into
//! shared memory and read in place. Frames, units and axes follow `docs/reference/conventions.md`.

#![cfg_attr(not(test), deny(clippy::disallowed_methods))]

mod byte_table;
mod class_table;
mod columns;
mod cube;
mod envelope;
mod finite;
mod id_table;
mod material_table;
mod placement;
pub mod pod;
mod raw;
mod ring_counts;
mod submap;
mod sweep;
mod tick;
mod trajectory;

pub use byte_table::{ByteField, ByteTable};
pub use class_table::{CLASS_TABLE_VERSION, ClassId, GROUND_CLASSES, UnknownClass, class_name};
pub use columns::{
    ClassHeader, ClassRow, ClassTopic, ColorHeader, ColorRow, ColorTopic, InstanceHeader, InstanceTopic, MAX_BANDS,
    MaterialHeader, MaterialRow, MaterialTopic, NO_SPECTRUM, RegionHeader, RegionTopic, SpectraHeader, SpectraTopic,
    SpectraView, UNSEEN,
};
pub use cube::{CubeHeader, CubeTopic, CubeView, MAX_CUBE_BANDS};
pub use envelope::{Envelope, Message};
pub use finite::{NotFinite, check_header, check_rows};
pub use material_table::{MATERIAL_TABLE_VERSION, MaterialId, material_name};
pub use placement::{FRAME_EAST_NORTH_UP, FRAME_LOCAL, PlacementHeader, PlacementRow, PlacementTopic, PoseDeviation};
pub use pod::Pod;
pub(crate) use pod::pod;
pub use raw::{GnssRow, GnssTopic, ImageHeader, ImageTopic, ImuRow, ImuTopic, MosaicHeader, MosaicTopic, NoHeader};
pub use ring_counts::RingCounts;
#[cfg(feature = "geometry")]
pub use submap::pose_numbers;
pub use submap::{
    CheckedSubmap, MAX_SWEEPS_PER_SUBMAP, POINT_DYNAMIC, POINT_INCIDENCE_UNKNOWN, SubmapError, SubmapHeader,
    SubmapPoint, SubmapSweep, SubmapTopic,
};
pub use sweep::{MAX_LIDARS, SweepHeader, SweepPoint, SweepTopic};
pub use tick::{NO_DRIVE_TIME, TickRow, TickTopic};
pub use trajectory::{PoseError, PoseRow, StampedPose, TrajectoryTopic};
