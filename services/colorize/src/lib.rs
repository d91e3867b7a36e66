//! `colorize`: gives the points of a submap colors from images, spectra from cubes (thesis 2.5.1, 4.3.2), and materials from the spectra.
//!
//! A point gets its color from one of the exposures that see it, at most `max_age_s` from its shot (`max_moving_age_s` for
//! points on moving objects). Its spectrum comes from each mosaic camera in the same way. Projection, occlusion and choice of
//! exposure are in the crate `coloring`. The pose of an exposure is interpolated in the trajectory at the middle of the
//! exposure.
//!
//! # When a submap is colored
//! Exposures up to `max_age_s` after the last shot of a submap may color its points. `colorize` therefore holds a
//! submap until the trajectory has passed `stamp_end + max_age_s`, the next submap arrives, or the stream ends,
//! whichever is first in the order of ticks. At most one submap is therefore held between ticks, and no tick publishes
//! more columns than the `QUEUE` of the topics allows; that includes the last tick, in which the held submap and all
//! new ones are due. The next submap arrives earlier only if submaps are shorter than `max_age_s` (20 m at more than 72
//! km/h): later exposures are then missed, and `submaps_colored_early` counts the submap.
//!
//! # Memory
//! Images and cubes stay in shared memory until no held or future submap can need them. The `BORROWED` of their topics
//! limits their number; `exposures_released_early` counts the exposures beyond it.
//!
//! # Entry point and invariants
//! Start at `Colorize::step` in `colorize.rs`; the crate `coloring` explains how a point gets its exposure. The stage
//! must never move, drop or reorder a point: its columns have the length and the order of their submap. It never
//! invents a color: a point that no exposure sees has no color.

#![cfg_attr(not(test), deny(clippy::disallowed_methods))]

mod colorize;
mod saved;

pub use colorize::Colorize;

stage::settings! {
    /// Settings of colorize.
    pub struct Settings {
        /// Largest time between the shot of a point and the exposure of its color, s. A submap also waits this long for exposures after its end.
        pub max_age_s: f64 = 1.0 => stage::within(0.01, 10.0);
        /// Largest time between the shot of a point on a moving object and the exposure of its color, s. In 0.1 s a car
        /// at 36 km/h moves 1 m.
        pub max_moving_age_s: f64 = 0.1 => stage::within(0.0, 10.0);
        /// Level the brightness of overlapping exposures, and replace an exposure that is saturated or black at a point
        /// by another one.
        pub level_exposures: bool = true => stage::any();
        /// Where the pixel of a point shows the sky, e.g. at the rim of a tree, use an adjacent pixel or another
        /// exposure; without these the point gets no color.
        pub reject_sky: bool = true => stage::any();
        /// Publish the material of every point that a mosaic camera sees, with a score (topic `material`).
        pub materials: bool = false => stage::any();
        /// Publish the region of every point that a mosaic camera sees (topic `region`); needs `[calibrate] color_lines`.
        pub regions: bool = false => stage::any();
        /// Offset between the outlines of points and images above which a camera is reported at the end of the run, mrad. 5 mrad are 10 cm at 20 m.
        pub max_offset_mrad: f64 = 5.0 => stage::within(0.1, 100.0);
        /// Delay between an exposure and its stamp above which it is reported, ms.
        pub max_delay_ms: f64 = 5.0 => stage::within(0.1, 1000.0);
        /// Share of points with a color below which the result is doubtful, if the drive has cameras. One camera with a field of
        /// view of 40 degrees sees a ninth of all directions; 0.05 is half of that.
        pub min_colored_share: f64 = 0.05 => stage::within(0.0, 1.0);
        /// Share of the images or cubes of one camera that do not match the rig or have no pose, above which the result
        /// is doubtful. A few exposures before the first and after the last sweep are normal; half of them indicate a
        /// wrong clock.
        pub max_unused_exposures_share: f64 = 0.5 => stage::within(0.0, 1.0);
    }
}
