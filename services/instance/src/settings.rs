//! Settings of instance.

use instance_segmentation::{FootprintSettings, Kind};
use messages::ClassId;
use serde::{Deserialize, Serialize};
use stage::Rule;

stage::settings! {
    /// Settings of instance. Cells, dilation, holes, heights and points have the defaults of thesis section 6.5.2.
    pub struct Settings {
        /// Cell size of the top-down view, m.
        pub cell_m: f64 = 0.1 => stage::within(0.02, 1.0);
        /// Dilation that joins the parts of an object, m.
        pub dilation_m: f64 = 0.2 => stage::within(0.0, 2.0);
        /// Holes with fewer cells than this are filled.
        pub hole_cells: u32 = 10 => stage::within(0, 10_000);
        /// Minimum fraction of the observed cells around an object that must have ground; 0 disables the filter.
        pub min_ground_around: f64 = 0.0 => stage::within(0.0, 1.0);
        /// Points of a cell that are separated by at least this time belong to different objects, s; 0 ignores times.
        pub apart_s: f64 = 0.6 => stage::within(0.0, 60.0);
        /// Minimum overlap, as a fraction of the smaller footprint, for an object to be associated with an object of an earlier submap.
        pub min_overlap: f64 = 0.1 => stage::within(0.0, 1.0);
        /// Number of submaps for which an unobserved object keeps its id; 0 disables tracking over submaps.
        pub remembered_submaps: u32 = 3 => stage::within(0, 100);
        /// Classes with instances, in the order in which ids are assigned.
        pub things: Vec<Thing> = Thing::defaults() => EachThingIsValid;
    }
}

/// A class with instances, an entry of `things`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Thing {
    /// Name in the class table.
    pub class: String,
    /// Maximum height of points above the ground, m.
    pub max_height_m: f64,
    /// Number of points in a submap with which an instance is accepted at any distance: the rule of the thesis.
    pub min_points: u32,
    /// Share of the points that the LiDAR is expected to have on an instance at this distance, over all sweeps of the
    /// submap. An instance is accepted with fewer points than `min_points` if it has this share. 0 always requires
    /// `min_points`.
    #[serde(default)]
    pub min_share: f64,
    /// Minimum number of points of an instance that is accepted by `min_share`.
    #[serde(default)]
    pub min_points_sparse: u32,
    /// Length of a typical instance, m: determines its expected points, and the parts of a moving one.
    #[serde(default)]
    pub length_m: f64,
    /// Height of a typical instance, m.
    #[serde(default)]
    pub height_m: f64,
    /// Minimum mean class score of the points, 0 to 1.
    #[serde(default)]
    pub min_score: f64,
    /// Two elevation peaks that each stand out by at least this height are two instances, m: roofs of cars bumper to bumper, heads of
    /// people in a group. 0 disables splitting.
    #[serde(default)]
    pub peak_m: f64,
    /// Parts up to this distance are joined if no ground was seen between them and the result is not longer than
    /// `max_length_m` and not wider than half of its length, m; 0 disables joining.
    #[serde(default)]
    pub join_m: f64,
    /// Maximum length of an instance that is joined from parts, m.
    #[serde(default)]
    pub max_length_m: f64,
    /// Largest speed at which a moving instance is tracked from sweep to sweep, m/s; 0 disables tracking within a
    /// submap.
    #[serde(default)]
    pub max_speed_mps: f64,
}

impl Thing {
    /// Heights and points of the thesis, and fewer points for objects according to their density. Touching roofs and
    /// heads are split. Speeds are bounds: 250 km/h, to which makers limit cars, and a runner.
    fn defaults() -> Vec<Self> {
        let vehicles = Self {
            class: ClassId::Vehicles.name().to_owned(),
            max_height_m: 4.0,
            min_points: 500,
            min_share: 0.1,
            min_points_sparse: 20,
            length_m: 4.5,
            height_m: 1.5,
            min_score: 0.55,
            peak_m: 0.2,
            join_m: 0.8,
            max_length_m: 5.6,
            max_speed_mps: 70.0,
        };
        let pedestrian = Self {
            class: ClassId::Pedestrian.name().to_owned(),
            max_height_m: 3.0,
            min_points: 100,
            min_share: 0.2,
            min_points_sparse: 10,
            length_m: 0.8,
            height_m: 1.7,
            min_score: 0.6,
            peak_m: 0.4,
            join_m: 0.0,
            max_length_m: 0.0,
            max_speed_mps: 6.0,
        };
        vec![vehicles, pedestrian]
    }
}

/// Every entry names a different class, and its numbers are in range.
struct EachThingIsValid;

impl Rule<Vec<Thing>> for EachThingIsValid {
    fn allows(&self, things: &Vec<Thing>) -> bool {
        let is_valid = |(idx, thing): (usize, &Thing)| {
            let is_known = ClassId::from_name(&thing.class).is_some_and(|class| class != ClassId::Unlabeled);
            is_known
                && things[..idx].iter().all(|other| other.class != thing.class)
                && (0.1..=100.0).contains(&thing.max_height_m)
                && thing.min_points >= 1
                && [thing.min_score, thing.min_share].iter().all(|share| (0.0..=1.0).contains(share))
                && [thing.length_m, thing.height_m].iter().all(|side| (0.0..=50.0).contains(side))
                && (thing.min_share == 0.0 || (thing.length_m > 0.0 && thing.height_m > 0.0))
                && (0.0..=100.0).contains(&thing.max_speed_mps)
                && (thing.max_speed_mps == 0.0 || thing.length_m > 0.0)
                && [thing.peak_m, thing.join_m].iter().all(|length| (0.0..=5.0).contains(length))
                && (0.0..=50.0).contains(&thing.max_length_m)
        };
        things.iter().enumerate().all(is_valid)
    }
    fn text(&self) -> String {
        "must be a list of { class, max_height_m, min_points, min_share, min_points_sparse, length_m, height_m, min_score, peak_m, join_m, \
         max_length_m, max_speed_mps }: each class of the class table but unlabeled once at most, max_height_m 0.1 to 100, min_points at \
         least 1, min_share and min_score 0 to 1, length_m and height_m 0 to 50, peak_m and join_m 0 to 5, max_length_m 0 to 50, \
         max_speed_mps 0 to 100; min_share needs length_m and height_m, max_speed_mps needs length_m"
            .to_owned()
    }
}

impl Settings {
    /// The settings for `instance_segmentation`.
    pub(crate) fn footprints(&self) -> FootprintSettings {
        FootprintSettings {
            dilation_m: self.dilation_m,
            hole_cells: self.hole_cells as usize,
            min_ground_around: self.min_ground_around,
            apart_s: self.apart_s,
        }
    }

    /// The entries in the order in which ids are assigned. Unknown classes have already been refused.
    pub(crate) fn kinds(&self) -> Vec<Kind> {
        let kind = |thing: &Thing| {
            Some(Kind {
                class: ClassId::from_name(&thing.class)?,
                max_height_m: thing.max_height_m as f32,
                min_points: thing.min_points as usize,
                min_score: thing.min_score,
                peak_m: thing.peak_m,
                join_m: thing.join_m,
                max_length_m: thing.max_length_m,
                max_speed_mps: thing.max_speed_mps,
                length_m: thing.length_m,
                height_m: thing.height_m,
                min_share: thing.min_share,
                min_points_sparse: thing.min_points_sparse as usize,
            })
        };
        self.things.iter().filter_map(kind).collect()
    }
}
