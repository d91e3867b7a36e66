//! Corrections of classes by mathematical morphology (thesis section 6.3.2). Corrections of range images are in
//! `spherical`.

use crate::vehicle_shape::no_vehicles;
use geometry::BevGrid;
use ground::SubmapGround;
use messages::ClassId::{self, Building, Terrain, Vegetation};
use messages::{ClassRow, SubmapPoint};
use morphology::{Connectivity, connected_components, geodesic_elongations};
use ndarray::Array2;

/// Selection of corrections.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[expect(clippy::struct_excessive_bools, reason = "each correction is chosen for itself")]
pub struct Refinement {
    /// Thin objects that stand out in the depth image become poles; poles that are not thin lose their class.
    pub poles: bool,
    /// Regions of buildings and vegetation with fewer than 100 pixels get the surrounding class.
    pub small_regions: bool,
    /// Regions of the top view that are higher than 2.5 m and have a geodesic elongation above 20 become buildings.
    pub buildings: bool,
    /// Terrain and unpaved ground become vegetation where the ground is rough, if the model has this class. Not from
    /// the thesis.
    pub rough_ground: bool,
    /// Clusters of vehicle points that are too low or have too few points for a vehicle get their second class. Not from
    /// the thesis.
    pub vehicle_shape: bool,
    /// The ground below the path of the LiDAR is road: other kinds of ground lose in the whole submap what they have too
    /// much there. Not from the thesis.
    pub driven_is_road: bool,
}

impl Refinement {
    /// No correction.
    pub const NONE: Self = Self {
        poles: false,
        small_regions: false,
        buildings: false,
        rough_ground: false,
        vehicle_shape: false,
        driven_is_road: false,
    };
}

impl Default for Refinement {
    /// The corrections that are not from the thesis. The thesis' corrections do not improve the shipped model.
    fn default() -> Self {
        Self { rough_ground: true, vehicle_shape: true, driven_is_road: true, ..Self::NONE }
    }
}

/// Points below this height are ground for poles and buildings, m.
pub(crate) const GROUND_M: f32 = 0.3;
/// Classes with which low vegetation is confused. Ring errors also make pavements rough.
const SOIL: [ClassId; 2] = [Terrain, ClassId::Ground];
const BUILDING_M: f32 = 2.5;
const BUILDING_ELONGATION: f64 = 20.0;
/// Side of the cells of the top view, m, and their largest number.
const CELL_M: f64 = 0.2;
const MAX_CELLS: usize = 1 << 24;

impl Refinement {
    /// Corrects the classes of the points of a submap from their heights above the ground.
    ///
    /// `of_model` are the classes that the model distinguishes. `without` returns the row of a point that cannot have a
    /// class.
    pub(crate) fn refine(
        self,
        points: &[SubmapPoint],
        ground: &SubmapGround,
        of_model: &[ClassId],
        classes: &mut [ClassRow],
        without: impl Fn(usize, ClassId) -> ClassRow,
    ) {
        if self.vehicle_shape {
            for point in no_vehicles(points, &ground.heights_m, classes) {
                classes[point] = without(point, ClassId::Vehicles);
            }
        }
        if self.buildings {
            buildings(points, &ground.heights_m, classes);
        }
        if self.rough_ground && of_model.contains(&Vegetation) {
            let is_soil = |row: &ClassRow| SOIL.iter().any(|class| *class as u8 == row.class_id);
            for (row, is_rough) in classes.iter_mut().zip(ground.ground.is_rough()) {
                if is_rough && is_soil(row) {
                    row.class_id = Vegetation as u8;
                }
            }
        }
    }
}

fn buildings(points: &[SubmapPoint], heights_m: &[f32], classes: &mut [ClassRow]) {
    let high = || points.iter().zip(heights_m).filter(|(_, height_m)| **height_m > BUILDING_M);
    let mut min = [f64::INFINITY; 2];
    let mut max = [f64::NEG_INFINITY; 2];
    for (point, _) in high() {
        for (k, value) in [f64::from(point.x), f64::from(point.y)].into_iter().enumerate() {
            (min[k], max[k]) = (min[k].min(value), max[k].max(value));
        }
    }
    let Some(grid) = BevGrid::covering_coarsened(min, max, CELL_M, MAX_CELLS) else { return };
    let cell = |point: &SubmapPoint| grid.cell(f64::from(point.x), f64::from(point.y));
    let mut is_high = Array2::from_elem((grid.rows, grid.cols), false);
    high().filter_map(|(point, _)| cell(point)).for_each(|cell| is_high[cell] = true);
    let structures = connected_components(&is_high, Connectivity::Eight);
    let elongations = geodesic_elongations(&structures);
    for ((point, height_m), row) in points.iter().zip(heights_m).zip(classes) {
        let label = cell(point).map_or(0, |cell| structures.image[cell]) as usize;
        if *height_m > GROUND_M && label > 0 && elongations[label - 1] > BUILDING_ELONGATION {
            row.class_id = Building as u8;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ground::Ground;
    use messages::SubmapHeader;
    use random::Random;

    #[test]
    fn high_and_elongated_region_becomes_building() {
        let point = |x: f32, y: f32, z: f32| SubmapPoint { x, y, z, ..SubmapPoint::default() };
        // A facade of 40 m, and a square of 6 m.
        let mut points: Vec<SubmapPoint> = (0..400).map(|i| point(0.1 * i as f32, 0.0, 4.0)).collect();
        points.extend((0..900).map(|i| point(0.2 * (i % 30) as f32, 20.0 + 0.2 * (i / 30) as f32, 4.0)));
        points.extend([point(10.0, 0.0, 1.0), point(10.0, 0.0, 0.1)]);
        let mut rows = vec![ClassRow { class_id: Vegetation as u8, score: 200 }; points.len()];
        let ground = Ground::find(&SubmapHeader::default(), &points);
        let ground = SubmapGround { ground, heights_m: points.iter().map(|point| point.z).collect() };
        let refinement = Refinement { buildings: true, ..Refinement::NONE };
        refinement.refine(&points, &ground, &[Building], &mut rows, |_, _| unreachable!("no vehicles"));
        let classes: Vec<u8> = rows.iter().map(|row| row.class_id).collect();
        assert!(classes[..400].iter().all(|class| *class == Building as u8));
        assert!(classes[400..1300].iter().all(|class| *class == Vegetation as u8));
        assert_eq!(classes[1300..], [Building as u8, Vegetation as u8]);
    }

    #[test]
    fn ground_on_rough_terrain_becomes_vegetation() {
        let mut random = Random::new(3);
        let mut point = |i: usize| {
            let x = random.range(0.0, 20.0);
            let y = random.range(-5.0, 5.0);
            let roughness_m = if y > 0.0 { 0.12 } else { 0.01 };
            let class_id = if i.is_multiple_of(2) { Terrain } else { Building } as u8;
            let z = roughness_m * random.gauss();
            (SubmapPoint { x, y, z, ..SubmapPoint::default() }, ClassRow { class_id, score: 200 })
        };
        let (points, before): (Vec<SubmapPoint>, Vec<ClassRow>) = (0..40_000).map(&mut point).unzip();
        let ground = SubmapGround::find(&SubmapHeader::default(), &points);
        let refined = |of_model: &[ClassId]| {
            let mut rows = before.clone();
            Refinement::default().refine(&points, &ground, of_model, &mut rows, |_, _| unreachable!("no vehicles"));
            rows
        };
        let rows = refined(&[Terrain, Building, Vegetation]);
        let mut n_changed = 0;
        for ((point, before), row) in points.iter().zip(&before).zip(&rows) {
            let is_changed = row != before;
            assert!(!is_changed || row.class_id == Vegetation as u8 && before.class_id == Terrain as u8);
            // Near the border the vote of the surrounding cells decides.
            assert!(!is_changed || point.y > -1.0, "{point:?}");
            n_changed += usize::from(is_changed && point.y > 1.0);
        }
        let n_rough = points.iter().zip(&before).filter(|(point, row)| point.y > 1.0 && row.class_id == Terrain as u8);
        assert!(n_changed as f64 > 0.9 * n_rough.count() as f64, "{n_changed}");
        assert!(refined(&[Terrain, Building]) == before, "a model without vegetation");
    }
}
