//! Simulated towns.

use super::{Args, count};
use crate::commands::train::recipe::town_from_name;
use crate::town_sweeps::{Mount, TownDrive};
use learning::scores::Confusion;
use learning::{Cloud, Segmenter};
use messages::{ClassId, ClassRow};

/// Truth that no model is asked for: thesis section 6.2 leaves out unlabeled, other, dynamic and sky.
const NOT_SCORED: [ClassId; 4] = [ClassId::Unlabeled, ClassId::Other, ClassId::Dynamic, ClassId::Sky];

/// Confusion of each drive.
pub fn confusions(model: &dyn Segmenter, args: &Args) -> anyhow::Result<Vec<(String, Confusion)>> {
    let mut clouds = Vec::new();
    let mut picture = args.picture.as_deref();
    for name in &args.towns {
        let town = town_from_name(name)?;
        for &seed in &args.seeds {
            let drive = TownDrive { town, seed, seconds: args.seconds };
            let mut confusion = Confusion::new(ClassId::ALL.len());
            let (mut n_sweeps, mut seconds, mut reliability) = (0, 0.0, Reliability::default());
            for submap in drive.submaps(args.submaps, args.sweeps, 1, Mount::Rig)? {
                let mut classes = vec![ClassRow::default(); submap.points.len()];
                let begin = std::time::Instant::now();
                let cloud = Cloud { header: &submap.header, points: &submap.points, colors: None };
                model.segment(&cloud, &mut classes)?;
                seconds += begin.elapsed().as_secs_f64();
                n_sweeps += args.sweeps;
                let predicted: Vec<u8> = classes.iter().map(|row| row.class_id).collect();
                if let Some(path) = picture.take() {
                    super::picture::write(path, &submap.points, &submap.truth, &predicted)?;
                }
                let is_scored = |class: u8| !NOT_SCORED.iter().any(|not| *not as u8 == class);
                for (row, truth) in classes.iter().zip(&submap.truth).filter(|(_, truth)| is_scored(**truth)) {
                    reliability.add(f64::from(row.score) / 255.0, row.class_id == *truth);
                }
                confusion.merge(&count(&submap.truth, &predicted, is_scored));
            }
            eprintln!(
                "{name} {seed}: {:.1} ms per sweep, expected calibration error {:.1} %",
                1e3 * seconds / f64::from(n_sweeps.max(1) as u32),
                100.0 * reliability.error()
            );
            clouds.push((format!("{name}-{seed}"), confusion));
        }
    }
    Ok(clouds)
}

/// Scores against the share of right answers, in ten bins of the score.
#[derive(Default)]
struct Reliability {
    /// Points, sum of their scores, right ones.
    bins: [(f64, f64, f64); 10],
}

impl Reliability {
    fn add(&mut self, score: f64, is_right: bool) {
        let bin = &mut self.bins[((score * 10.0) as usize).min(9)];
        *bin = (bin.0 + 1.0, bin.1 + score, bin.2 + f64::from(u8::from(is_right)));
    }
    /// Mean distance of a bin's scores from its share of right answers (Guo et al. 2017).
    fn error(&self) -> f64 {
        let n: f64 = self.bins.iter().map(|bin| bin.0).sum();
        self.bins.iter().map(|(_, scores, right)| (scores - right).abs()).sum::<f64>() / n.max(1.0)
    }
}
