//! A submap whose sweeps go through a network that the caller runs, in any library.

use super::features::features;
use super::range_sweep::{RangeSweep, SweepPoints, rows_of};
use super::softmax::{NO_VOTE, Vote};
use super::sweep_images::{Prepared, SweepImages};
use crate::{ModelInput, Report, SegmentationError, SpectraColumn};
use ground::SubmapGround;
use kernels::images::Planes;
use messages::{ClassRow, ColorRow, SpectraHeader, SubmapHeader, SubmapPoint};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

/// A submap and the columns that a model reads, with owned memory.
pub struct OwnedSubmap {
    /// Sweeps and sensor positions.
    pub header: Box<SubmapHeader>,
    /// Points in the submap frame.
    pub points: Vec<SubmapPoint>,
    /// A color for every point.
    pub colors: Option<Vec<ColorRow>>,
    /// The spectra of the points.
    pub spectra: Option<OwnedSpectra>,
}

/// A message of topic `spectra`, with owned memory.
pub struct OwnedSpectra {
    /// Bands and counts.
    pub header: Box<SpectraHeader>,
    /// Index of the spectrum of each point, then the spectra.
    pub rows: Vec<u32>,
}

/// The classes of a submap.
pub struct SegmentedSubmap {
    /// The class of every point.
    pub classes: Vec<ClassRow>,
    /// How the points were classified.
    pub report: Report,
}

impl OwnedSubmap {
    fn input(&self) -> ModelInput<'_> {
        let spectra =
            self.spectra.as_ref().map(|spectra| SpectraColumn { header: &spectra.header, rows: &spectra.rows });
        ModelInput { colors: self.colors.as_deref(), spectra, ..ModelInput::new(&self.header, &self.points) }
    }
}

/// A submap whose sweeps go through a network that the caller runs.
///
/// Images and scores are plain arrays in the order of `PyTorch`: channel, row, column. Columns are the angles of a full
/// revolution, so a convolution reads the opposite edge beyond the left and right one; above and below the image there
/// are zeros.
///
/// 1. [`Self::images`] returns the inputs of the network for some sweeps.
/// 2. [`Self::vote`] takes the scores of the network for one of them.
/// 3. [`Self::classes`] returns the classes from the votes so far.
pub struct SubmapSweeps {
    images: Arc<SweepImages>,
    submap: OwnedSubmap,
    prepared: Prepared,
    /// Sweeps whose images were returned and whose scores are still missing.
    pending: BTreeMap<usize, RangeSweep>,
    votes: Vec<Vote>,
}

impl SubmapSweeps {
    /// Finds the ground and the scale of the intensities.
    ///
    /// # Errors
    /// If a column has a different number of rows than the submap.
    pub fn new(images: Arc<SweepImages>, submap: OwnedSubmap) -> Result<Self, SegmentationError> {
        let input = submap.input();
        input.check_columns()?;
        let prepared = images.prepare(&input, SubmapGround::find(input.header, input.points));
        let votes = vec![NO_VOTE; submap.points.len()];
        Ok(Self { images, submap, prepared, pending: BTreeMap::new(), votes })
    }
    /// Channels, rows and columns of the image of each sweep. LiDARs with different numbers of rings have different numbers of rows.
    pub fn sizes(&self) -> Vec<[usize; 3]> {
        let size = |of: &SweepPoints| self.images.input_size(rows_of(&self.submap.header, &of.sweep));
        self.prepared.sweeps.iter().map(size).collect()
    }
    /// The images of these sweeps, one after another.
    ///
    /// # Panics
    /// If there are fewer sweeps.
    pub fn images(&mut self, sweeps: Range<usize>) -> Vec<f32> {
        let input = self.submap.input();
        let source = self.images.source(&input, &self.prepared);
        let settings = self.images.settings();
        let image = |of: &SweepPoints| {
            let sweep = self.prepared.sweep(&source, of);
            let row_multiple = settings.network.multiple_of()[0];
            let image = features(&sweep.polar, &settings.features, settings.fold, row_multiple);
            (sweep, image.to_channels_first())
        };
        let (shown, images): (Vec<_>, Vec<_>) = self.prepared.sweeps[sweeps.clone()].par_iter().map(image).unzip();
        self.pending.extend(sweeps.zip(shown));
        images.concat()
    }
    /// Takes the scores of the network for a sweep, before the softmax. Scores of a folded column are in consecutive
    /// channels, like its features.
    ///
    /// # Errors
    /// If the number of scores differs from the output of the model's network.
    ///
    /// # Panics
    /// If there is no such sweep.
    pub fn vote(&mut self, sweep: usize, scores: &[f32]) -> Result<(), SegmentationError> {
        let of = &self.prepared.sweeps[sweep];
        let channels = self.images.settings().network.outputs();
        let [_, height, width] = self.images.input_size(rows_of(&self.submap.header, &of.sweep));
        if scores.len() != channels * height * width {
            let expected = [channels, height, width];
            return Err(SegmentationError::Scores { sweep, found: scores.len(), expected });
        }
        let mut planes = Planes::zeros(channels, height, width);
        planes.write_channels_first(scores);
        let shown = self.pending.remove(&sweep).unwrap_or_else(|| {
            let input = self.submap.input();
            self.prepared.sweep(&self.images.source(&input, &self.prepared), of)
        });
        self.images.vote(&shown, &mut self.votes[of.points.clone()], |votes| {
            self.images.softmax(&shown.polar, planes.view(), votes);
            Ok(())
        })
    }
    /// The class of every point from the votes of the sweeps so far.
    pub fn classes(&self) -> SegmentedSubmap {
        let mut classes = vec![ClassRow::default(); self.votes.len()];
        let input = self.submap.input();
        let cells = self.images.cells(&input, &self.votes);
        let report = self.images.decide(&input, &self.prepared, cells, &mut classes);
        SegmentedSubmap { classes, report }
    }
}
