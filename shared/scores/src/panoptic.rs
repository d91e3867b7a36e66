//! Scores of instances: panoptic quality (Kirillov et al. 2019) and those of thesis table 6.11.
//!
//! A predicted and a true instance of one class match if their intersection over union (IoU) is above 1/2; each then matches no
//! other. Points whose truth is void count for nobody: they are left out of unions, and a prediction that lies on them for more
//! than half is no false one (the rule of panopticapi). Points of a thing class that the truth gives no instance are void for
//! predictions of that class alone (a "crowd").

use std::collections::BTreeMap;

/// What is said of one point.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct PointLabel {
    /// Id in the class table.
    pub class: u8,
    /// 0 = none.
    pub instance: u32,
}

/// How many points each pair of labels has; over any number of clouds, in any order.
#[derive(Clone, Debug, Default)]
pub struct Overlaps {
    /// By truth, then prediction.
    pairs: BTreeMap<(PointLabel, PointLabel), u64>,
    /// The pair of the last point, not in `pairs` yet: neighbors in a cloud mostly have one label.
    run: Option<((PointLabel, PointLabel), u64)>,
}

/// The scores of one class. Shares are 0 to 1; those of nothing are NaN.
#[derive(Clone, Debug, PartialEq)]
pub struct ClassScore {
    /// Id in the class table.
    pub class: u8,
    /// Instances of the truth.
    pub n_true: usize,
    /// Instances of the prediction, without those on void.
    pub n_predicted: usize,
    /// IoU of the matches, in the order of the true instances' ids.
    pub matches: Vec<f64>,
}

impl ClassScore {
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
    /// Mean IoU over the true instances, 0 for those without a match: the column mIoU of thesis table 6.11, whose values lie
    /// below 1/2 where few are matched.
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

    /// The scores of `class`. Points whose true class is `void` count for nobody; true instances of fewer than `min_points` are
    /// as points of the class without an instance.
    pub fn score(&mut self, class: u8, void: u8, min_points: u64) -> ClassScore {
        self.flush();
        let is_segment = |label: &PointLabel| label.class == class && label.instance != 0;
        let mut truth: BTreeMap<u32, u64> = BTreeMap::new();
        let mut predicted: BTreeMap<u32, u64> = BTreeMap::new();
        let mut on_void: BTreeMap<u32, [u64; 2]> = BTreeMap::new();
        let mut both: BTreeMap<(u32, u32), u64> = BTreeMap::new();
        for ((t, _), &n) in self.pairs.iter().filter(|((t, _), _)| is_segment(t)) {
            *truth.entry(t.instance).or_default() += n;
        }
        truth.retain(|_, n| *n >= min_points);
        for ((t, p), &n) in &self.pairs {
            let is_true = is_segment(t) && truth.contains_key(&t.instance);
            if is_segment(p) {
                *predicted.entry(p.instance).or_default() += n;
                let [void_n, crowd_n] = on_void.entry(p.instance).or_default();
                if t.class == void {
                    *void_n += n;
                } else if t.class == class && !is_true {
                    *crowd_n += n;
                }
            }
            if is_true && is_segment(p) {
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
        ClassScore {
            class,
            n_true: truth.len(),
            n_predicted: matches.len() + n_false,
            matches: matches.into_values().map(|(_, iou)| iou).collect(),
        }
    }
}
