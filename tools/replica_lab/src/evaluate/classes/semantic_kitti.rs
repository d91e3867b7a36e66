//! Evaluates a model on labelled sweeps of SemanticKITTI.

mod labelled_sweep;
mod sweep_files;

pub use labelled_sweep::{LabelledSweep, labelled_sweeps};

use super::labelled_submap::LabelledSubmap;
use super::labels::Labels;
use super::models::Models;
use super::seven;
use super::source::{Origin, Source};
use super::tally::{Tally, TrueClass};
use command_line::say_error;
use formats::semantic_kitti::CLASS_OF_BENCHMARK_ID;
use geometry::SphericalGrid;
use messages::ClassId::Unlabeled;
use messages::{SubmapHeader, SubmapPoint};
use std::path::Path;
use std::time::Instant;

/// Sweeps of sequence 08, the validation set of the benchmark.
const BENCHMARK_SWEEPS: usize = 4071;

/// Sweeps after which progress is printed.
const PROGRESS: usize = 500;

/// The HDL-64E of KITTI, upright 1.73 m above the road.
pub const GRID: SphericalGrid = SphericalGrid { rows: 64, columns: 36_000, up: 0.035, down: -0.436 };

/// Whether the figures of these sweeps can be compared with published ones.
pub fn comparability(sources: &[Source]) -> Option<String> {
    let real: Vec<&Source> = sources.iter().filter(|source| source.origin == Origin::SemanticKitti).collect();
    let n_sweeps: usize = real.iter().map(|source| source.n_sweeps).sum();
    let sweeps = if n_sweeps == 1 { "sweep" } else { "sweeps" };
    match real[..] {
        [] => None,
        [of_sequence] if of_sequence.name == "08" && n_sweeps == BENCHMARK_SWEEPS => Some(format!(
            "{n_sweeps} {sweeps}, all of sequence 08: the seven classes compare with published benchmarks; our classes do not, because \
             they merge classes of SemanticKITTI"
        )),
        _ => Some(format!("{n_sweeps} {sweeps}: not comparable with published benchmarks")),
    }
}

/// Scores the model on each sequence of a folder, one sweep in memory at a time.
pub fn sources(models: &Models, folder: &Path, empty: &Tally) -> anyhow::Result<Vec<Source>> {
    let sequences = sweep_files::sequences(folder)?;
    sequences.into_iter().map(|sequence| source(models, &sequence, empty)).collect()
}

fn source(models: &Models, sequence: &sweep_files::Sequence, empty: &Tally) -> anyhow::Result<Source> {
    let name = sequence.name.clone();
    let n_sweeps = sequence.sweeps.len();
    let origin = Origin::SemanticKitti;
    let tally = empty.clone();
    let mut source = Source { name, origin, n_sweeps, has_intensities: false, tally, other_uses: Vec::new() };
    let mut other_uses: Vec<Tally> = models.other_uses.iter().map(|_| empty.clone()).collect();
    let begin = Instant::now();
    for (number, files) in (1..).zip(&sequence.sweeps) {
        let submap = submap(&LabelledSweep::read(files)?);
        let mut asked = empty.clone();
        submap.score(&mut asked, models.asked.as_ref(), Labels::SemanticKitti)?;
        source.tally.merge(&asked);
        // A sweep without intensities gets the same classes for every use.
        let is_used = submap.points.iter().any(|point| point.intensity > 0);
        source.has_intensities |= is_used;
        for (tally, (_, model)) in other_uses.iter_mut().zip(&models.other_uses) {
            if is_used {
                submap.score(tally, model.as_ref(), Labels::SemanticKitti)?;
            } else {
                tally.merge(&asked);
            }
        }
        if number % PROGRESS == 0 && number < n_sweeps {
            say_error!("{}: {number} of {n_sweeps} sweeps", source.name);
        }
    }
    if source.has_intensities {
        source.other_uses = models.other_uses.iter().map(|(word, _)| *word).zip(other_uses).collect();
    }
    let ms = 1e3 * begin.elapsed().as_secs_f64() / n_sweeps.max(1) as f64;
    say_error!("{}: {ms:.0} ms per sweep", source.name);
    Ok(source)
}

/// Converts a sweep to a submap. Ring and azimuth come from the spherical projection.
fn submap(sweep: &LabelledSweep) -> LabelledSubmap {
    let points: Vec<SubmapPoint> =
        sweep.points.iter().zip(&sweep.intensities).map(|(xyz, of)| row(*xyz, *of)).collect();
    let truth = |id: &u32| {
        let class = CLASS_OF_BENCHMARK_ID[*id as usize];
        (class != Unlabeled).then(|| TrueClass { class: class as u8, seven: seven::from_benchmark_id(*id) })
    };
    LabelledSubmap {
        header: SubmapHeader::one_sweep(points.len(), GRID.rows),
        truth: sweep.ids.iter().map(truth).collect(),
        points,
    }
}

/// A return of the HDL-64E.
pub fn row([x, y, z]: [f32; 3], intensity: u8) -> SubmapPoint {
    // Points slightly outside the range of elevations belong to the outermost lasers.
    let flat = (x * x + y * y).sqrt();
    let elevation = z.atan2(flat).clamp(GRID.down + 1e-4, GRID.up - 1e-4);
    let (ring_row, column) = GRID.pixel([x, y, flat * elevation.tan()]).unwrap_or((GRID.rows - 1, 0));
    SubmapPoint {
        x,
        y,
        z,
        // Columns of the projection count counter-clockwise, azimuths clockwise.
        azimuth: (35_999 - column) as u16,
        ring: (GRID.rows - 1 - ring_row) as u8,
        intensity,
        ..SubmapPoint::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_whole_validation_sequence_is_comparable() {
        let source = |name: &str, n_sweeps: usize| Source {
            name: name.to_owned(),
            origin: Origin::SemanticKitti,
            n_sweeps,
            has_intensities: true,
            tally: Tally::new(),
            other_uses: Vec::new(),
        };
        let said = |sources: &[Source]| comparability(sources).expect("real sweeps");
        let three = [source("a", 1), source("b", 1), source("c", 1)];
        assert_eq!(said(&three), "3 sweeps: not comparable with published benchmarks");
        assert_eq!(said(&[source("00", 4541)]), "4541 sweeps: not comparable with published benchmarks");
        assert_eq!(said(&[source("08", 1)]), "1 sweep: not comparable with published benchmarks");
        assert!(said(&[source("08", 4071)]).starts_with("4071 sweeps, all of sequence 08: the seven classes compare"));
        assert_eq!(comparability(&[]), None);
    }
}
