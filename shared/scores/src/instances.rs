//! Scores of instances: panoptic quality (Kirillov et al. 2019) and the scores of thesis table 6.11.
//!
//! A predicted and a true instance of one class match if their intersection over union (IoU) is above 1/2; then neither
//! matches another. Points whose truth is void are ignored: unions do not include them, and a prediction with more than
//! half of its points on void is not a false positive (the rule of panopticapi). Points of a class whose truth has no
//! instance (a "crowd") are void for predictions of that class only.

use std::collections::BTreeMap;

/// The label of one point.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct PointLabel {
    /// Id in the class table.
    pub class: u8,
    /// Instance id; 0 without an instance.
    pub instance: u32,
}

/// The number of points of each pair of true and predicted label, over any number of clouds, in any order.
#[derive(Clone, Debug, Default)]
pub struct Overlaps {
    /// Number of points by true label, then predicted label.
    pairs: BTreeMap<(PointLabel, PointLabel), u64>,
    /// The latest pair, not yet in `pairs`. Consecutive points mostly have equal labels, so they are counted here first.
    run: Option<((PointLabel, PointLabel), u64)>,
}

/// The scores of one class, 0 to 1. A score without instances is NaN.
#[derive(Clone, Debug, PartialEq)]
pub struct InstanceScores {
    /// Id in the class table.
    pub class: u8,
    /// Number of true instances.
    pub n_true: usize,
    /// Number of predicted instances, without predictions on void.
    pub n_predicted: usize,
    /// IoU of the matches, sorted by true instance id.
    pub matches: Vec<f64>,
}

impl InstanceScores {
    /// Segment matching: share of the true instances that are matched.
    pub fn sm(&self) -> f64 {
        self.matches.len() as f64 / self.n_true as f64
    }
    /// Segmentation quality: mean IoU of the matches.
    pub fn sq(&self) -> f64 {
        self.matches.iter().sum::<f64>() / self.matches.len() as f64
    }
    /// Recognition quality: the F1 score of the instances.
    pub fn rq(&self) -> f64 {
        2.0 * self.matches.len() as f64 / (self.n_true + self.n_predicted) as f64
    }
    /// Panoptic quality, `SQ * RQ`.
    pub fn pq(&self) -> f64 {
        2.0 * self.matches.iter().sum::<f64>() / (self.n_true + self.n_predicted) as f64
    }
    /// Mean IoU over the true instances, with 0 for instances without a match: column mIoU of thesis table 6.11.
    pub fn miou(&self) -> f64 {
        self.matches.iter().sum::<f64>() / self.n_true as f64
    }
}

impl Overlaps {
    /// Counts one point.
    #[inline]
    pub fn add(&mut self, truth: PointLabel, predicted: PointLabel) {
        match &mut self.run {
            Some((pair, n)) if *pair == (truth, predicted) => *n += 1,
            _ => {
                self.flush();
                self.run = Some(((truth, predicted), 1));
            }
        }
    }

    fn flush(&mut self) {
        if let Some((pair, n)) = self.run.take() {
            *self.pairs.entry(pair).or_default() += n;
        }
    }

    /// The scores of `class`. Points whose true class is `void` are ignored. True instances of fewer than `min_points` are treated as
    /// points of the class without an instance.
    pub fn score(&mut self, class: u8, void: u8, min_points: u64) -> InstanceScores {
        self.flush();
        let is_of_class = |label: &PointLabel| label.class == class && label.instance != 0;
        let mut truth: BTreeMap<u32, u64> = BTreeMap::new();
        let mut predicted: BTreeMap<u32, u64> = BTreeMap::new();
        let mut on_void: BTreeMap<u32, [u64; 2]> = BTreeMap::new();
        let mut both: BTreeMap<(u32, u32), u64> = BTreeMap::new();
        for ((t, _), &n) in self.pairs.iter().filter(|((t, _), _)| is_of_class(t)) {
            *truth.entry(t.instance).or_default() += n;
        }
        truth.retain(|_, n| *n >= min_points);
        for ((t, p), &n) in &self.pairs {
            let is_true = is_of_class(t) && truth.contains_key(&t.instance);
            if is_of_class(p) {
                *predicted.entry(p.instance).or_default() += n;
                let [void_n, crowd_n] = on_void.entry(p.instance).or_default();
                if t.class == void {
                    *void_n += n;
                } else if t.class == class && !is_true {
                    *crowd_n += n;
                }
            }
            if is_true && is_of_class(p) {
                *both.entry((t.instance, p.instance)).or_default() += n;
            }
        }
        let mut matches: BTreeMap<u32, (u32, f64)> = BTreeMap::new();
        for (&(t, p), &n) in &both {
            let union = truth[&t] + predicted[&p] - n - on_void[&p][0];
            if 2 * n > union {
                matches.insert(t, (p, n as f64 / union as f64));
            }
        }
        let is_matched = |id: u32| matches.values().any(|(p, _)| *p == id);
        let is_false = |&(&p, &n): &(&u32, &u64)| 2 * on_void[&p].iter().sum::<u64>() <= n;
        let n_false = predicted.iter().filter(|(p, _)| !is_matched(**p)).filter(is_false).count();
        InstanceScores {
            class,
            n_true: truth.len(),
            n_predicted: matches.len() + n_false,
            matches: matches.into_values().map(|(_, iou)| iou).collect(),
        }
    }
}
