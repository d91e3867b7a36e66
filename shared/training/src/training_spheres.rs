//! The centers of training spheres, balanced over all classes (thesis 6.3.2).

use random::Random;
use std::collections::BTreeMap;

/// Items from which training spheres are drawn, by class: points, or submaps that contain points of a class.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TrainingSpheres {
    items: BTreeMap<u8, Vec<Item>>,
}

/// An item of a class.
#[derive(Clone, Debug, PartialEq)]
struct Item {
    number: u32,
    /// Cumulative weight of the items of the class up to this one.
    weight_up_to: f64,
}

/// The item from which the center of a training sphere is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DrawnItem {
    /// Class of the center.
    pub class: u8,
    /// Number that the item was added with.
    pub item: u32,
}

impl TrainingSpheres {
    /// Adds an item of a class. An item with twice the weight is drawn twice as often within its class.
    pub fn add(&mut self, class: u8, item: u32, weight: f64) {
        let items = self.items.entry(class).or_default();
        let before = items.last().map_or(0.0, |last| last.weight_up_to);
        items.push(Item { number: item, weight_up_to: before + weight });
    }
    /// Draws the item for a sphere of an epoch, counted from 0. The numbers of spheres per class differ by at most one;
    /// the item is random. `None` without items.
    pub fn draw(&self, sphere: usize, random: &mut Random) -> Option<DrawnItem> {
        let (class, items) = self.items.iter().nth(sphere % self.items.len().max(1))?;
        let at = f64::from(random.unit()) * items.last()?.weight_up_to;
        let place = items.partition_point(|item| item.weight_up_to <= at).min(items.len() - 1);
        Some(DrawnItem { class: *class, item: items[place].number })
    }
}
