//! What counts as a thing.

use messages::ClassId;
use serde::{Deserialize, Serialize};
use stage::Rule;

stage::settings! {
    /// Settings of instance. Cells, dilation, holes, heights and points are those of thesis section 6.5.2.
    pub struct Settings {
        /// Side of a cell of the top-down view, m.
        pub cell_m: f64 = 0.1 => stage::within(0.02, 1.0);
        /// How far the cells of a thing are grown to join its parts, m.
        pub dilation_m: f64 = 0.2 => stage::within(0.0, 2.0);
        /// Holes of fewer cells than this belong to the thing around them.
        pub hole_cells: u32 = 10 => stage::within(0, 10_000);
        /// Share of the cells around a thing, of those with points, that must have ground; 0 = not asked.
        pub min_ground_around: f64 = 0.1 => stage::within(0.0, 1.0);
        /// What passes through a cell at different times is not one thing: apart by at least this long, s; 0 = times are not
        /// looked at.
        pub apart_s: f64 = 0.6 => stage::within(0.0, 60.0);
        /// Share of the smaller of two footprints that must overlap for a thing to be that of an earlier submap.
        pub min_overlap: f64 = 0.2 => stage::within(0.0, 1.0);
        /// For how many submaps a thing that is not seen is remembered; 0 = every submap has things of its own.
        pub remembered_submaps: u32 = 3 => stage::within(0, 100);
        /// Classes whose members are told apart, in the order in which their ids are given.
        pub things: Vec<Thing> = Thing::defaults() => EachThingIsSound;
    }
}

/// One class whose members are told apart, an entry of `things`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Thing {
    /// Its name in the class table.
    pub class: String,
    /// Height above the ground up to which points belong to a thing, m.
    pub max_height_m: f64,
    /// Points of a thing in a submap at least.
    pub min_points: u32,
    /// Mean score of its points at least, 0 to 1: how sure the model is of its class.
    #[serde(default)]
    pub min_score: f64,
    /// Two peaks of the elevation that each stand out by this much are two things, m: roofs of cars bumper to bumper, heads of
    /// people in a group. 0 = nothing is parted.
    #[serde(default)]
    pub peak_m: f64,
    /// Parts that are up to this far apart are one thing if it is no longer than `max_length_m`, m; 0 = parts are not joined.
    #[serde(default)]
    pub join_m: f64,
    /// Length of the longest thing that is joined of parts, m.
    #[serde(default)]
    pub max_length_m: f64,
}

impl Thing {
    /// Heights and points of the thesis; roofs that touch and heads in a group are parted, and people must be more likely than not.
    fn defaults() -> Vec<Self> {
        let thing = |class: ClassId, max_height_m: f64, min_points: u32, min_score: f64, peak_m: f64| Self {
            class: class.name().to_owned(),
            max_height_m,
            min_points,
            min_score,
            peak_m,
            join_m: 0.0,
            max_length_m: 0.0,
        };
        vec![thing(ClassId::Vehicles, 4.0, 500, 0.0, 0.2), thing(ClassId::Pedestrian, 3.0, 100, 0.5, 0.4)]
    }
}

/// Every entry names a class that no other names, and its numbers are in their ranges.
struct EachThingIsSound;

impl Rule<Vec<Thing>> for EachThingIsSound {
    fn allows(&self, things: &Vec<Thing>) -> bool {
        let is_sound = |(idx, thing): (usize, &Thing)| {
            let is_known = ClassId::from_name(&thing.class).is_some_and(|class| class != ClassId::Unlabeled);
            is_known
                && things[..idx].iter().all(|other| other.class != thing.class)
                && (0.1..=100.0).contains(&thing.max_height_m)
                && thing.min_points >= 1
                && (0.0..=1.0).contains(&thing.min_score)
                && [thing.peak_m, thing.join_m].iter().all(|length| (0.0..=5.0).contains(length))
                && (0.0..=50.0).contains(&thing.max_length_m)
        };
        things.iter().enumerate().all(is_sound)
    }
    fn text(&self) -> String {
        "must be a list of { class, max_height_m, min_points, min_score, peak_m, join_m, max_length_m }: each class of the class table but \
         unlabeled once at most, max_height_m 0.1 to 100, min_points at least 1, min_score 0 to 1, peak_m and join_m 0 to 5, max_length_m 0 to 50"
            .to_owned()
    }
}

/// An entry as the algorithm wants it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Kind {
    pub(crate) class: ClassId,
    pub(crate) max_height_m: f32,
    pub(crate) min_points: usize,
    pub(crate) min_score: f64,
    pub(crate) peak_m: f64,
    pub(crate) join_m: f64,
    pub(crate) max_length_m: f64,
}

impl Settings {
    /// In the order in which ids are given. Entries of unknown classes have been refused before.
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
            })
        };
        self.things.iter().filter_map(kind).collect()
    }
}
