//! From probabilities in cells to the classes of points.

use crate::cell_probabilities::CellProbabilities;
use crate::class_rows::write_rows;
use crate::driven_path::{DrivenPath, road_factors};
use crate::refinement::Refinement;
use crate::views::mean_over_views;
use crate::{CellSegmenter, ModelInput, Report, SegmentationError, SubmapProbabilities};
use ground::SubmapGround;
use messages::{ClassId, ClassRow};

/// How a model decides.
pub(crate) struct Decision<'a> {
    /// The classes of the probabilities, in order.
    pub of_model: &'a [ClassId],
    pub refinement: Refinement,
}

impl Decision<'_> {
    /// Writes the class of each point, with all corrections. `given` are classes of points that the model does not
    /// classify. Returns the number of unlabeled points.
    pub fn write(
        &self,
        input: &ModelInput<'_>,
        ground: &SubmapGround,
        cells: CellProbabilities,
        given: impl Fn(usize) -> Option<ClassRow>,
        classes: &mut [ClassRow],
    ) -> usize {
        let cells = if self.refinement.driven_is_road { self.without_road_bias(input, ground, cells) } else { cells };
        let rows = cells.decide(self.of_model).enumerate().map(|(point, decided)| given(point).unwrap_or(decided));
        let n_unseen = write_rows(rows, classes);
        let without = |point: usize, class: ClassId| cells.decide_without(point, class, self.of_model);
        self.refinement.refine(input.points, ground, self.of_model, classes, without);
        n_unseen
    }

    /// The probabilities, with the bias below the path divided out.
    fn without_road_bias(
        &self,
        input: &ModelInput<'_>,
        ground: &SubmapGround,
        cells: CellProbabilities,
    ) -> CellProbabilities {
        let Some(path) = DrivenPath::find(input.header) else { return cells };
        let below = path.ground(input.points, &ground.heights_m).filter_map(|point| cells.at(point));
        match road_factors(below, self.of_model) {
            Some(factors) => cells.scaled(&factors),
            None => cells,
        }
    }
}

/// Segments a submap by the probabilities of a model, the mean over `n_views` views.
pub(crate) fn segment_by_cells(
    model: &dyn CellSegmenter,
    n_views: usize,
    input: &ModelInput<'_>,
    classes: &mut [ClassRow],
) -> Result<Report, SegmentationError> {
    input.check(classes)?;
    let ground = SubmapGround::find(input.header, input.points);
    let [SubmapProbabilities { cells, report }] = mean_over_views([model], n_views, input, &ground)?;
    let decision = Decision { of_model: model.classes(), refinement: model.refinement() };
    Ok(Report { n_unseen: decision.write(input, &ground, cells, |_| None, classes), ..report })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{ModelCard, Segmenter};
    use messages::ClassId::{Road, Terrain, Vegetation, Vehicles};
    use messages::{SubmapHeader, SubmapPoint};
    use std::sync::Arc;

    /// Takes rough asphalt for a lawn, and low bushes for vehicles.
    struct Biased(Refinement);

    const CLASSES: [ClassId; 4] = [Road, Terrain, Vegetation, Vehicles];

    impl Segmenter for Biased {
        fn card(&self) -> &ModelCard {
            unreachable!("is not asked for")
        }
        fn segment(&self, input: &ModelInput<'_>, classes: &mut [ClassRow]) -> Result<Report, SegmentationError> {
            segment_by_cells(self, 1, input, classes)
        }
    }

    impl CellSegmenter for Biased {
        fn classes(&self) -> &[ClassId] {
            &CLASSES
        }
        fn refinement(&self) -> Refinement {
            self.0
        }
        fn probabilities(
            &self,
            input: &ModelInput<'_>,
            _: &Arc<SubmapGround>,
        ) -> Result<SubmapProbabilities, SegmentationError> {
            let row = |point: &SubmapPoint| match point.ring {
                // A fifth is rougher.
                ASPHALT if point.azimuth.is_multiple_of(5) => [0.38, 0.52, 0.1, 0.0],
                ASPHALT => [0.4, 0.5, 0.1, 0.0],
                LAWN => [0.1, 0.8, 0.1, 0.0],
                _ => [0.0, 0.0, 0.4, 0.6],
            };
            let rows = input.points.iter().flat_map(row).collect();
            let cells = CellProbabilities::new(CLASSES.len(), rows, (0..input.points.len() as u32).collect());
            Ok(SubmapProbabilities { cells, report: Report::default() })
        }
    }

    const ASPHALT: u8 = 0;
    const LAWN: u8 = 1;
    const BUSH: u8 = 2;

    /// A road along x of 6 m, a lawn on the left of it, and a bush of 0.4 m on the lawn.
    fn street() -> (Box<SubmapHeader>, Vec<SubmapPoint>) {
        let mut points = Vec::new();
        let mut add = |n: u16, y_m: f32, z: f32, ring: u8| {
            for (i, j) in (0..200_u16).flat_map(|i| (0..n).map(move |j| (i, j))) {
                let [x, y] = [0.1 * f32::from(i) - 5.0, y_m + 0.1 * f32::from(j)];
                points.push(SubmapPoint { x, y, z, azimuth: i, ring, ..SubmapPoint::default() });
            }
        };
        add(60, -3.0, 0.0, ASPHALT);
        add(60, 3.0, 0.0, LAWN);
        add(3, 6.0, 0.4, BUSH);
        let mut header: Box<SubmapHeader> = Box::default();
        header.n_sweeps = 2;
        for (sweep, x) in header.sweeps.iter_mut().zip([0.0, 2.5]) {
            sweep.n_points = 1;
            sweep.submap_from_lidar_begin = [x, 0.0, 1.9, 0.0, 0.0, 0.0, 1.0];
            sweep.submap_from_lidar_end = sweep.submap_from_lidar_begin;
        }
        (header, points)
    }

    #[test]
    fn bias_below_the_path_is_divided_out_everywhere_and_low_vehicles_get_their_second_class() {
        let (header, points) = street();
        let class_of = |refinement: Refinement, ring: u8| {
            let mut classes = vec![ClassRow::default(); points.len()];
            Biased(refinement).segment(&ModelInput::new(&header, &points), &mut classes).expect("segments");
            let of_ring = points.iter().zip(&classes).filter(|(point, _)| point.ring == ring);
            let found: Vec<u8> = of_ring.map(|(_, row)| row.class_id).collect();
            let n_points = |class: ClassId| found.iter().map(|&id| usize::from(id == class as u8)).sum::<usize>();
            CLASSES
                .into_iter()
                .find(|&class| 4 * n_points(class) > 3 * found.len())
                .expect("most points have one class")
        };
        let both = Refinement { driven_is_road: true, vehicle_shape: true, ..Refinement::NONE };
        assert_eq!([ASPHALT, LAWN, BUSH].map(|ring| class_of(both, ring)), [Road, Terrain, Vegetation]);
        assert_eq!([ASPHALT, LAWN, BUSH].map(|ring| class_of(Refinement::NONE, ring)), [Terrain, Terrain, Vehicles]);
    }
}
