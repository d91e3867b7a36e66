//! An example of a third-party segmenter. It depends on the `stage` crate alone, and can replace infer because it reads
//! and writes the same topics.
//!
//! Classes come from heights alone, in columns of half a metre: low points are ground, a compact heap of the height of
//! a car near the vehicle's path is a car, and a tall column is a building if it has returns between knee and head
//! height, otherwise the crown of a tree. That is sufficient to demonstrate a swap, and to give `instance` input.

mod columns;

use columns::{Column, ColumnMap, Key};
use stage::messages::pod::{FINGERPRINT_START, fingerprint};
use stage::messages::{CLASS_TABLE_VERSION, ClassHeader, ClassId, ClassRow, ClassTopic, SubmapHeader, SubmapTopic};
use stage::{Context, Flow, Inputs, Outputs, Port, Received, Stage, StepError};
use std::collections::BTreeSet;

stage::settings! {
    /// Settings of the segmenter.
    pub struct Settings {
        /// Height up to which a point is ground, m.
        pub ground_m: f32 = 0.3 => stage::within(0.05, 1.0);
        /// Height of the highest vehicle, m.
        pub vehicle_m: f32 = 2.6 => stage::within(1.0, 5.0);
        /// Largest distance of vehicles from the path of the sensor, m.
        pub street_m: f32 = 15.0 => stage::within(1.0, 200.0);
    }
}

/// Largest length of a vehicle. A longer heap is a hedge or a wall.
const VEHICLE_LENGTH_COLUMNS: i32 = 14;
/// Least size of a vehicle. A smaller heap is a post or a person.
const VEHICLE_MIN_COLUMNS: usize = 6;
/// The score of every point, 0.7: the rules have no confidence of their own, and the stage `instance` discards things
/// with a score close to one half (`min_score`).
const SCORE: u8 = 179;

/// The stage.
pub struct HeightSegmenter {
    settings: Settings,
}

impl HeightSegmenter {
    fn class_of_column(&self, column: &Column, is_vehicle: bool) -> ClassId {
        match column.top_m() {
            _ if is_vehicle => ClassId::Vehicles,
            top if top <= self.settings.vehicle_m => ClassId::Unlabeled,
            _ if column.has_middle => ClassId::Building,
            _ => ClassId::Vegetation,
        }
    }

    /// Columns of the heaps in the street that have the height and the size of a vehicle.
    fn vehicles(&self, map: &ColumnMap, header: &SubmapHeader) -> BTreeSet<Key> {
        let is_heap =
            |column: &Column| column.top_m() > self.settings.ground_m && column.top_m() <= self.settings.vehicle_m;
        let heaps = map.components(is_heap);
        let compact = heaps.into_iter().filter(|heap| {
            let length = |part: fn(&Key) -> i32| {
                let (min, max) = heap.iter().map(part).fold((i32::MAX, i32::MIN), |(a, b), v| (a.min(v), b.max(v)));
                max - min + 1
            };
            let long = length(|key| key.0).max(length(|key| key.1));
            heap.len() >= VEHICLE_MIN_COLUMNS && long <= VEHICLE_LENGTH_COLUMNS && self.in_street(heap[0], header)
        });
        compact.flatten().collect()
    }

    /// Whether the sensor passed nearby; `true` if the submap has no sensor positions.
    fn in_street(&self, key: Key, header: &SubmapHeader) -> bool {
        let (x, y) = columns::center(key);
        let sweeps = header.sweeps.get(..header.n_sweeps as usize).unwrap_or_default();
        let is_near = |[px, py, ..]: [f32; 7]| (px - x).hypot(py - y) <= self.settings.street_m;
        sweeps.is_empty() || sweeps.iter().any(|sweep| is_near(sweep.submap_from_lidar_begin))
    }

    fn label(&self, submap: &Received<SubmapTopic>, rows: &mut [ClassRow]) {
        let map = ColumnMap::from_points(submap.rows());
        let vehicles = self.vehicles(&map, submap.header());
        for (row, point) in rows.iter_mut().zip(submap.rows()) {
            let Some((key, column)) = map.column_of(point) else { continue };
            let class = if point.z - column.ground_m <= self.settings.ground_m {
                ClassId::Ground
            } else {
                self.class_of_column(column, vehicles.contains(&key))
            };
            *row = ClassRow { class_id: class as u8, score: if class == ClassId::Unlabeled { 0 } else { SCORE } };
        }
    }
}

impl Stage for HeightSegmenter {
    const NAME: &'static str = "infer";
    type Settings = Settings;

    fn inputs() -> Vec<Port> {
        vec![Port::of::<SubmapTopic>()]
    }

    fn outputs() -> Vec<Port> {
        vec![Port::of::<ClassTopic>()]
    }

    fn new(settings: &Settings, _context: &Context) -> Result<Self, StepError> {
        Ok(Self { settings: settings.clone() })
    }

    fn step(&mut self, inputs: &mut Inputs, outputs: &mut Outputs) -> Result<Flow, StepError> {
        for submap in inputs.take::<SubmapTopic>() {
            let n_points = submap.rows().len();
            let mut loan = outputs.loan::<ClassTopic>(n_points)?;
            let model_digest = fingerprint(FINGERPRINT_START, b"height_segmenter 1");
            *loan.header_mut() = ClassHeader { class_table_version: CLASS_TABLE_VERSION, model_digest };
            let rows = loan.grow(n_points)?;
            self.label(&submap, rows);
            outputs.publish_column(loan, submap.stamp(), submap.seq())?;
        }
        Ok(Flow::Continue)
    }

    fn save(&mut self) -> Result<stage::StateBytes<'_>, StepError> {
        Ok(stage::StateBytes::default())
    }
}
