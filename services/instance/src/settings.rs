//! What counts as a thing.

use messages::ClassId;

stage::settings! {
    /// Settings of instance. Defaults as in thesis section 6.5.2.
    pub struct Settings {
        /// Side of a cell of the top-down view, m.
        pub cell_m: f64 = 0.1 => stage::within(0.02, 1.0);
        /// How far the cells of a thing are grown to join its parts, m.
        pub dilation_m: f64 = 0.2 => stage::within(0.0, 2.0);
        /// Holes of fewer cells than this belong to the thing around them.
        pub hole_cells: u32 = 10 => stage::within(0, 10_000);
        /// Share of the cells around a thing, of those with points, that must have ground; 0 = not asked.
        pub min_ground_around: f64 = 0.1 => stage::within(0.0, 1.0);
        /// Height above the ground up to which points belong to a vehicle, m.
        pub vehicles_max_height_m: f64 = 4.0 => stage::within(0.1, 100.0);
        /// Points of a vehicle at least.
        pub vehicles_min_points: u32 = 500 => stage::at_least(1);
        /// Height above the ground up to which points belong to a pedestrian, m.
        pub pedestrian_max_height_m: f64 = 3.0 => stage::within(0.1, 100.0);
        /// Points of a pedestrian at least.
        pub pedestrian_min_points: u32 = 100 => stage::at_least(1);
    }
}

/// One class whose members are counted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Thing {
    pub(crate) class: ClassId,
    pub(crate) max_height_m: f32,
    pub(crate) min_points: usize,
}

impl Settings {
    /// In the order in which ids are given.
    pub(crate) fn things(&self) -> [Thing; 2] {
        [
            Thing {
                class: ClassId::Vehicles,
                max_height_m: self.vehicles_max_height_m as f32,
                min_points: self.vehicles_min_points as usize,
            },
            Thing {
                class: ClassId::Pedestrian,
                max_height_m: self.pedestrian_max_height_m as f32,
                min_points: self.pedestrian_min_points as usize,
            },
        ]
    }
}
