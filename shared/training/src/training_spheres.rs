//! The centers of training spheres: all classes equally often (thesis 6.3.2).

use random::Random;
use std::collections::BTreeMap;

/// What training spheres are drawn from, by class: points, or submaps that have points of a class.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TrainingSpheres {
    items: BTreeMap<u8, Vec<Item>>,
}

/// An item of a class.
#[derive(Clone, Debug, PartialEq)]
struct Item {
    number: u32,
    /// Sum of its weight and the weights of the items of the class before it.
    weight_up_to: f64,
}

/// What the center of a training sphere is drawn from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DrawnItem {
    /// Class of the center.
    pub class: u8,
    /// Number of the item, as it was added.
    pub item: u32,
}

impl TrainingSpheres {
    /// Adds an item of a class. An item of twice the weight is drawn twice as often as others of its class.
    pub fn add(&mut self, class: u8, item: u32, weight: f64) {
        let items = self.items.entry(class).or_default();
        let before = items.last().map_or(0.0, |last| last.weight_up_to);
        items.push(Item { number: item, weight_up_to: before + weight });
    }
    /// What a sphere of an epoch, counted from 0, is drawn from. Each class is drawn equally often, but for one sphere; the item is
    /// random. `None` without items.
    pub fn draw(&self, sphere: usize, random: &mut Random) -> Option<DrawnItem> {
        let (class, items) = self.items.iter().nth(sphere % self.items.len().max(1))?;
        let at = f64::from(random.unit()) * items.last()?.weight_up_to;
        let place = items.partition_point(|item| item.weight_up_to <= at).min(items.len() - 1);
        Some(DrawnItem { class: *class, item: items[place].number })
    }
}
