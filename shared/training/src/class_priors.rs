//! Priors of the classes: factors of their probabilities that maximize the mean IoU.
//!
//! A fused model predicts rare classes too seldom: a loss over points weights them less than the mean IoU does, and the
//! geometric mean requires two models to agree. A factor for each class shifts the decisions without another training
//! ("logit adjustment", Menon et al. 2021, "Long-tail learning via logit adjustment"). It is fitted to the mean IoU
//! itself, one class after another.

use rayon::prelude::*;
use scores::Confusion;

/// Natural logarithms of the priors that are compared, in tenths: factors of 1 to 20. Priors only raise classes: lowering
/// gains little on the drives of the fit, and loses on motorways and real sweeps.
const TENTHS: std::ops::RangeInclusive<i32> = 0..=30;
const N_STEPS: usize = 31;
/// Largest number of rounds over all classes; only the first two or three change a prior.
const ROUNDS: usize = 6;
/// Least gain in mean IoU per unit of the logarithm of a prior: smaller gains do not transfer to other towns.
const GAIN: f64 = 2e-3;
/// Number of points per task.
const CHUNK: usize = 1 << 14;

/// Points with the probabilities of their classes, or numbers in proportion to them, and their true classes. One score
/// covers all points.
#[derive(Default)]
pub struct LabeledMeans {
    logarithms: Vec<f32>,
    truth: Vec<u8>,
}

impl LabeledMeans {
    /// Adds a point: a value above 0 for each class, and the number of its true class.
    pub fn push(&mut self, means: &[f32], truth: u8) {
        self.logarithms.extend(means.iter().map(|mean| mean.ln()));
        self.truth.push(truth);
    }
    /// Mean IoU of the classes with a prior for each; `None` without points.
    pub fn mean_iou(&self, priors: &[f32]) -> Option<f64> {
        let logarithms: Vec<f32> = priors.iter().map(|prior| prior.ln()).collect();
        let mut confusion = Confusion::new(priors.len());
        for (row, truth) in self.logarithms.chunks_exact(priors.len()).zip(&self.truth) {
            confusion.add(usize::from(*truth), best(row, &logarithms, None).class);
        }
        confusion.mean_iou()
    }
    /// The mean IoU for each logarithm of the prior of one class, with given logarithms of the others.
    fn mean_ious(&self, logarithms: &[f32], class: usize) -> [f64; N_STEPS] {
        let n_classes = logarithms.len();
        // Bin by the first prior with which the class wins, the true class, and the class that wins below this prior.
        let bin = |step: usize, truth: usize, other: usize| (step * n_classes + truth) * n_classes + other;
        let mut bins = vec![0_u64; (N_STEPS + 1) * n_classes * n_classes];
        let chunks = self.logarithms.par_chunks(CHUNK * n_classes).zip(self.truth.par_chunks(CHUNK));
        let counted: Vec<Vec<usize>> = chunks
            .map(|(rows, truth)| {
                let rows = rows.chunks_exact(n_classes).zip(truth);
                rows.map(|(row, &truth)| {
                    let Winner { class: other, sum: largest } = best(row, logarithms, Some(class));
                    let tenths = (10.0 * (largest - row[class])).ceil() - *TENTHS.start() as f32;
                    bin(tenths.clamp(0.0, N_STEPS as f32) as usize, usize::from(truth), other)
                })
                .collect()
            })
            .collect();
        counted.iter().flatten().for_each(|bin| bins[*bin] += 1);
        let mut won = vec![0_u64; n_classes * n_classes];
        let total = |truth, other| (0..=N_STEPS).map(|step| bins[bin(step, truth, other)]).sum::<u64>();
        let totals: Vec<u64> =
            (0..n_classes * n_classes).map(|pair| total(pair / n_classes, pair % n_classes)).collect();
        std::array::from_fn(|step| {
            let mut confusion = Confusion::new(n_classes);
            for pair in 0..n_classes * n_classes {
                let truth = pair / n_classes;
                let other = pair % n_classes;
                won[pair] += bins[bin(step, truth, other)];
                confusion.add_n(truth, class, won[pair]);
                confusion.add_n(truth, other, totals[pair] - won[pair]);
            }
            confusion.mean_iou().unwrap_or(0.0)
        })
    }
}

/// The class with the largest sum of the logarithms of mean and prior.
struct Winner {
    class: usize,
    sum: f32,
}

/// The winner at a point when one of the classes is excluded.
fn best(row: &[f32], logarithms: &[f32], without: Option<usize>) -> Winner {
    let mut best = Winner { class: 0, sum: f32::NEG_INFINITY };
    for (class, (mean, prior)) in row.iter().zip(logarithms).enumerate() {
        let sum = mean + prior;
        if Some(class) != without && sum > best.sum {
            best = Winner { class, sum };
        }
    }
    best
}

/// The factor of each class, 1 to 20 in two decimals, that maximizes the mean score over all groups of points (each score
/// is the mean IoU of the classes of the group). Classes are fitted one after another until no factor changes. Equal
/// groups give equal factors for any number of threads.
///
/// # Panics
/// If there are fewer than two classes, or a true class is not smaller than their number.
pub fn fit_priors(groups: &[LabeledMeans], n_classes: usize) -> Vec<f32> {
    assert!(n_classes >= 2, "{n_classes} classes");
    let mut tenths = vec![0; n_classes];
    for _ in 0..ROUNDS {
        let before = tenths.clone();
        for class in 0..n_classes {
            let logarithms: Vec<f32> = tenths.iter().map(|tenths| *tenths as f32 / 10.0).collect();
            let of_groups: Vec<[f64; N_STEPS]> =
                groups.iter().map(|group| group.mean_ious(&logarithms, class)).collect();
            let gain = |step: usize, tenths: i32| {
                let sum: f64 = of_groups.iter().map(|of_steps| of_steps[step]).sum();
                sum / groups.len().max(1) as f64 - GAIN * f64::from(tenths) / 10.0
            };
            let steps = TENTHS.enumerate().map(|(step, tenths)| (tenths, gain(step, tenths)));
            let first = (0, f64::NEG_INFINITY);
            tenths[class] = steps.fold(first, |best, next| if next.1 > best.1 { next } else { best }).0;
        }
        if tenths == before {
            break;
        }
    }
    tenths.iter().map(|tenths| (100.0 * (f64::from(*tenths) / 10.0).exp()).round() as f32 / 100.0).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use random::Random;

    /// The second of three classes is rare, and its probability is a third of the correct value.
    fn group(seed: u64, n_points: usize) -> LabeledMeans {
        let mut random = Random::new(seed);
        let mut group = LabeledMeans::default();
        for _ in 0..n_points {
            let truth = match random.unit() {
                u if u < 0.60 => 0,
                u if u < 0.65 => 1,
                _ => 2,
            };
            let mut means = [0.0; 3].map(|_: f32| (0.6 * random.gauss()).exp());
            means[usize::from(truth)] *= 6.0;
            means[1] /= 3.0;
            group.push(&means, truth);
        }
        group
    }

    #[test]
    fn prior_of_a_suppressed_class_is_raised_and_holds_on_other_points() {
        let groups = [group(1, 20_000), group(2, 20_000)];
        let priors = fit_priors(&groups, 3);
        assert!((1.3..4.0).contains(&(priors[1] / priors[0])), "{priors:?}");
        let unseen = group(3, 20_000);
        let [before, after] = [&[1.0; 3][..], &priors].map(|priors| unseen.mean_iou(priors).expect("has points"));
        assert!(after > before + 0.02, "{before} {after}");
    }

    #[test]
    fn score_of_each_step_is_that_of_the_decisions() {
        let group = group(4, 3_000);
        let of_steps = group.mean_ious(&[0.2, 0.0, -0.3], 1);
        for (step, tenths) in TENTHS.enumerate() {
            let priors = [0.2, tenths as f32 / 10.0, -0.3].map(f32::exp);
            let expected = group.mean_iou(&priors).expect("has points");
            assert!((of_steps[step] - expected).abs() < 2e-3, "{tenths}: {} {expected}", of_steps[step]);
        }
    }

    #[test]
    fn classes_without_points_and_no_groups_keep_their_priors() {
        assert_eq!(fit_priors(&[], 3), [1.0; 3]);
        let mut one = LabeledMeans::default();
        one.push(&[0.6, 0.3, 0.1], 0);
        assert_eq!(fit_priors(&[one], 3), [1.0; 3]);
    }

    #[test]
    fn number_of_threads_changes_nothing() {
        let priors = |n_threads| {
            let threads = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().expect("threads");
            threads.install(|| fit_priors(&[group(5, 50_000)], 3))
        };
        assert_eq!(priors(1), priors(3));
    }
}
