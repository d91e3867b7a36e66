//! The messages of all topics, and the table of the columns of a submap.
//!
//! A message is an [`Envelope`], a fixed header and a slice of rows, all plain `repr(C)` data that is written once into
//! shared memory and read in place. Each topic has a file with the byte table of its header and row. Frames, units and axes
//! follow `docs/reference/conventions.md`.
//!
//! | idea | module |
//! |---|---|
//! | definition of a topic; the first bytes of each message | [`Message`], [`Envelope`] |
//! | plain-data types; their layout for other languages | [`pod`], [`ByteTable`] |
//! | sensors: sweeps, images, mosaics, fixes, inertial samples | [`SweepTopic`], [`ImageTopic`], [`GnssTopic`] |
//! | points of a stretch of street; their final pose; trajectory of the vehicle | [`SubmapTopic`], [`PlacementTopic`], [`TrajectoryTopic`] |
//! | numbers of each point, and how they look in files | [`columns`] |
//! | names of classes and materials | [`ClassId`], [`MaterialId`] |
//! | steps of the source | [`TickTopic`] |
//!
//! This crate defines what the bytes mean. It must never compute with messages, open files or depend on their senders. A
//! change of a layout changes [`Message::LAYOUT`], a change of meaning must raise [`Message::VERSION`]; programs that
//! differ in either do not connect.
//!
//! Start reading with `envelope.rs`, then `submap.rs`, then `columns.rs`.

#![cfg_attr(not(test), deny(clippy::disallowed_methods))]

mod byte_table;
mod class_table;
pub mod columns;
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
    MAX_MOVING_INSTANCES, MaterialHeader, MaterialRow, MaterialTopic, NO_SPECTRUM, RegionHeader, RegionTopic,
    SpectraHeader, SpectraTopic, SpectraView, UNSEEN,
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
