//! Votes over views (test-time augmentation): the mean of a model's probabilities over the submap and changed copies of it.
//!
//! A network errs differently where a copy is tilted, larger or mirrored, so the mean is more often right and its scores are
//! better calibrated. Each view costs as much as the submap itself.

use crate::{CellProbabilities, CellSegmenter, ModelInput, SegmentationError, SubmapProbabilities};
use ground::SubmapGround;
use messages::{SubmapHeader, SubmapPoint};
use std::sync::Arc;

/// Steps of an azimuth, 0.01 deg.
const FULL_TURN: u16 = 36_000;

/// A change of the positions of a submap.
#[derive(Clone, Copy, Debug, PartialEq)]
enum View {
    /// Tilted about the y axis, deg.
    Tilted(f32),
    /// Larger by a factor.
    Scaled(f32),
    /// Mirrored: y becomes -y.
    Mirrored,
}

/// The views after the submap itself. The order was chosen on the data sets of `street_labels` except the `SemanticKITTI`
/// sweeps 0 to 2 of sequence 00: tilts gain most.
const VIEWS: [View; 5] =
    [View::Tilted(3.0), View::Tilted(-3.0), View::Scaled(0.93), View::Scaled(1.07), View::Mirrored];

/// Largest number of views, the submap itself included.
pub const MOST_VIEWS: usize = VIEWS.len() + 1;

impl View {
    fn position(self, [x, y, z]: [f32; 3]) -> [f32; 3] {
        match self {
            Self::Tilted(degrees) => {
                let (sin, cos) = degrees.to_radians().sin_cos();
                [cos * x + sin * z, y, cos * z - sin * x]
            }
            Self::Scaled(factor) => [x, y, z].map(|v| factor * v),
            Self::Mirrored => [x, -y, z],
        }
    }

    /// A return keeps its beam: only mirroring changes its azimuth.
    fn point(self, point: &SubmapPoint) -> SubmapPoint {
        let [x, y, z] = self.position([point.x, point.y, point.z]);
        let azimuth = match self {
            Self::Mirrored => (FULL_TURN - point.azimuth.min(FULL_TURN)) % FULL_TURN,
            _ => point.azimuth,
        };
        SubmapPoint { x, y, z, azimuth, ..*point }
    }

    /// Models read only the positions of the poses.
    fn header(self, header: &SubmapHeader) -> Box<SubmapHeader> {
        let mut changed = Box::new(*header);
        for sweep in &mut changed.sweeps {
            for pose in [&mut sweep.submap_from_lidar_begin, &mut sweep.submap_from_lidar_end] {
                let [x, y, z, ..] = *pose;
                pose[..3].copy_from_slice(&self.position([x, y, z]));
            }
        }
        changed
    }
}

/// Sums of probabilities by point.
struct Sums {
    n_classes: usize,
    sums: Vec<f32>,
    n_known: Vec<u8>,
}

impl Sums {
    fn new(n_classes: usize, n_points: usize) -> Self {
        Self { n_classes, sums: vec![0.0; n_points * n_classes], n_known: vec![0; n_points] }
    }

    fn add(&mut self, cells: &CellProbabilities) {
        let rows = self.sums.chunks_exact_mut(self.n_classes).zip(&mut self.n_known);
        for ((sums, n_known), probabilities) in rows.zip(cells.per_point()) {
            if let Some(probabilities) = probabilities {
                sums.iter_mut().zip(probabilities).for_each(|(sum, probability)| *sum += probability);
                *n_known += 1;
            }
        }
    }

    /// The means; each point is a cell.
    fn means(mut self) -> CellProbabilities {
        for (sums, n_known) in self.sums.chunks_exact_mut(self.n_classes).zip(&self.n_known) {
            let n = f32::from((*n_known).max(1));
            for sum in sums {
                *sum /= n;
            }
        }
        let cells = (0..self.n_known.len() as u32).collect();
        CellProbabilities::new(self.n_classes, self.sums, cells)
    }
}

/// The mean probabilities of models over the first `n_views` views, limited to 1 to [`MOST_VIEWS`]. Each view and its ground are
/// computed once for all models. The reports are the ones of the submap itself.
pub(crate) fn mean_over_views<const N: usize>(
    models: [&dyn CellSegmenter; N],
    n_views: usize,
    input: &ModelInput<'_>,
    ground: &Arc<SubmapGround>,
) -> Result<[SubmapProbabilities; N], SegmentationError> {
    let mut found = Vec::with_capacity(N);
    for model in models {
        found.push(model.probabilities(input, ground)?);
    }
    let mut found: [SubmapProbabilities; N] = found.try_into().unwrap_or_else(|_| unreachable!("one for each model"));
    let views = &VIEWS[..n_views.clamp(1, MOST_VIEWS) - 1];
    if views.is_empty() {
        return Ok(found);
    }
    let mut sums = models.map(|model| Sums::new(model.classes().len(), input.points.len()));
    sums.iter_mut().zip(&found).for_each(|(sums, found)| sums.add(&found.cells));
    for view in views {
        let header = view.header(input.header);
        let points: Vec<SubmapPoint> = input.points.iter().map(|point| view.point(point)).collect();
        let ground = SubmapGround::find(&header, &points);
        let changed = ModelInput { header: &header, points: &points, ..*input };
        for (model, sums) in models.iter().zip(&mut sums) {
            sums.add(&model.probabilities(&changed, &ground)?.cells);
        }
    }
    found.iter_mut().zip(sums).for_each(|(found, sums)| found.cells = sums.means());
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cell_probabilities::NO_CELL;
    use crate::decision::segment_by_cells;
    use crate::refinement::Refinement;
    use crate::{ModelCard, Report, Segmenter};
    use messages::{ClassId, ClassRow};

    /// Two classes; the probability of the first is the share of the points of positive y. The last point has no cell.
    struct LeftOrRight;

    impl Segmenter for LeftOrRight {
        fn card(&self) -> &ModelCard {
            unreachable!("is not asked for")
        }
        fn segment(&self, _: &ModelInput<'_>, _: &mut [ClassRow]) -> Result<Report, SegmentationError> {
            unreachable!("only its probabilities are used")
        }
    }

    impl CellSegmenter for LeftOrRight {
        fn classes(&self) -> &[ClassId] {
            &[ClassId::Road, ClassId::Pole]
        }
        fn refinement(&self) -> Refinement {
            Refinement::NONE
        }
        fn probabilities(
            &self,
            input: &ModelInput<'_>,
            _: &Arc<SubmapGround>,
        ) -> Result<SubmapProbabilities, SegmentationError> {
            let row = |point: &SubmapPoint| if point.y > 0.0 { [1.0, 0.0] } else { [0.0, 1.0] };
            let rows = input.points.iter().flat_map(row).collect();
            let n = input.points.len() as u32;
            let cells = (0..n).map(|cell| if cell + 1 == n { NO_CELL } else { cell }).collect();
            Ok(SubmapProbabilities { cells: CellProbabilities::new(2, rows, cells), report: Report::default() })
        }
    }

    fn rows(n_views: usize) -> Vec<ClassRow> {
        let at = |y: f32| SubmapPoint { x: 1.0, y, ..SubmapPoint::default() };
        let points = [at(2.0), at(-2.0), at(2.0)];
        let mut classes = [ClassRow::default(); 3];
        let header = SubmapHeader::default();
        let input = ModelInput::new(&header, &points);
        let report = segment_by_cells(&LeftOrRight, n_views, &input, &mut classes).expect("runs");
        assert_eq!(report.n_unseen, 1);
        classes.to_vec()
    }

    #[test]
    fn probabilities_are_means_over_the_views() {
        let row = |class: ClassId, score: u8| ClassRow { class_id: class as u8, score };
        // Tilts and scales do not move a point to the other side.
        let without_mirror = [row(ClassId::Road, 255), row(ClassId::Pole, 255), row(ClassId::Unlabeled, 0)];
        assert_eq!(rows(5), without_mirror);
        let five_of_six = 213;
        let with_mirror =
            [row(ClassId::Road, five_of_six), row(ClassId::Pole, five_of_six), row(ClassId::Unlabeled, 0)];
        assert_eq!(rows(MOST_VIEWS), with_mirror);
        assert_eq!(rows(99), with_mirror);
    }

    #[test]
    fn views_move_points_and_positions_of_the_lidar_alike() {
        let point = SubmapPoint { x: 3.0, y: -1.0, z: 2.0, azimuth: 1000, ring: 7, ..SubmapPoint::default() };
        let mut header: Box<SubmapHeader> = Box::default();
        header.sweeps[0].submap_from_lidar_end = [3.0, -1.0, 2.0, 0.0, 0.0, 0.0, 1.0];
        let norm = |[x, y, z]: [f32; 3]| (x * x + y * y + z * z).sqrt();
        for view in VIEWS {
            let moved = view.point(&point);
            let lidar = view.header(&header).sweeps[0].submap_from_lidar_end;
            assert_eq!([moved.x, moved.y, moved.z], lidar[..3], "{view:?}");
            let factor = if let View::Scaled(factor) = view { factor } else { 1.0 };
            assert!((norm([moved.x, moved.y, moved.z]) - factor * norm([3.0, -1.0, 2.0])).abs() < 1e-5, "{view:?}");
            assert_eq!(moved.ring, 7);
        }
        assert_eq!(View::Mirrored.point(&point).azimuth, 35_000);
        assert_eq!(View::Mirrored.point(&SubmapPoint::default()).azimuth, 0);
    }
}
