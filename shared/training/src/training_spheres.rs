//! The centers of training spheres: all classes equally often (thesis 6.3.2).

use random::Random;
use std::collections::BTreeMap;

/// What training spheres are drawn from, by class: points, or submaps that have points of a class.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TrainingSpheres {
    /// Items of each class, and the sum of their weights and of those before them.
    items: BTreeMap<u8, Vec<(u32, f64)>>,
}

impl TrainingSpheres {
    /// Adds an item of a class. An item of twice the weight is drawn twice as often as others of its class.
    pub fn add(&mut self, class: u8, item: u32, weight: f64) {
        let items = self.items.entry(class).or_default();
        let before = items.last().map_or(0.0, |(_, sum)| *sum);
        items.push((item, before + weight));
    }
    /// Class and item of a sphere of an epoch, counted from 0. Each class is drawn equally often, but for one sphere; the item is
    /// random. `None` without items.
    pub fn draw(&self, sphere: usize, random: &mut Random) -> Option<(u8, u32)> {
        let (class, items) = self.items.iter().nth(sphere % self.items.len().max(1))?;
        let (_, total) = items.last()?;
        let at = f64::from(random.unit()) * total;
        let place = items.partition_point(|(_, sum)| *sum <= at).min(items.len() - 1);
        Some((*class, items[place].0))
    }
}
