//! Camera images and spectral cubes onto the points of a submap (thesis 2.5.1, 4.3.2).
//!
//! Every point gets its color from one of the exposures that see it, at most `max_age_s` from its own shot (points on
//! moving objects: `max_moving_age_s`); its spectrum likewise, from each mosaic camera. A camera sees what is in its
//! view and not hidden behind other points of the submap ([`occlusion`]). Of several, the one is taken whose color is expected
//! to be off by the least: poses drift with the time between, and a camera's pointing tells more with range and toward the
//! rim of the image ([`choose`]). The body's pose at an exposure is interpolated from the trajectory, to the nanosecond of
//! the exposure's middle. A point that no exposure sees is unseen; nothing is guessed.
//!
//! # When a submap is colored
//! Exposures up to `max_age_s` after a submap's last shot may matter to its points. So a submap is held until the
//! trajectory has passed `stamp_end + max_age_s`, or until the next submap comes, or until the stream ends, whichever is first
//! in the order of ticks. Thus one submap at most is held between ticks, and no tick publishes more columns than the
//! topics' `QUEUE` allows, not even the last one, in which the held submap and all that come are due. The next submap
//! comes before its predecessor's time only where submaps are shorter than `max_age_s` (20 m at more than 72 km/h): then
//! late exposures are missed, and `submaps_colored_early` counts it.
//!
//! # What is held
//! Images and cubes stay where they are, in shared memory, from the time they come until no held or future submap can need
//! them; the topic's `BORROWED` bounds their number (`exposures_released_early` counts those beyond).
//!
//! # Wide registers
//! As in `wide_loops::run`, but the work is a struct with a `call` of its own, and a loop's arrays are those of one or two structs, of
//! constant length: only then is it certain at compile time that they do not overlap.

#![allow(clippy::needless_bitwise_bool, reason = "conditions without jumps let the loops over a chunk become vectors")]

pub mod choose;
pub mod chunk;
pub mod cloud;
pub mod color;
mod colorize;
pub mod depth_edges;
pub mod frustum;
pub mod lens;
pub mod level;
pub mod occlusion;
pub mod offset;
mod offset_edges;
pub mod offset_fit;
mod offset_search;
pub mod offset_watch;
mod saved;
pub mod spectra;
pub mod views;
mod warp_lens;
mod window;

pub use colorize::Colorize;

stage::settings! {
    /// Settings of colorize.
    pub struct Settings {
        /// Largest time between a point's shot and the exposure that it takes its color from, s. Also how long a submap waits for exposures after its end.
        pub max_age_s: f64 = 1.0 => stage::within(0.01, 10.0);
        /// The same for points on moving objects, s. At 0.1 s a car at 36 km/h is a metre further.
        pub max_moving_age_s: f64 = 0.1 => stage::within(0.0, 10.0);
        /// Whether exposures are made equally bright where they meet, by what points show that several of them see; and whether one that is white or black at a point loses it to another.
        pub level_exposures: bool = false => stage::any();
        /// Outlines in points and images that are farther apart than this are said to the operator at the end, mrad. 5 mrad are 10 cm at 20 m.
        pub max_offset_mrad: f64 = 5.0 => stage::within(0.1, 100.0);
        /// The same for the time between an exposure and its stamp, ms.
        pub max_delay_ms: f64 = 5.0 => stage::within(0.1, 1000.0);
    }
}
