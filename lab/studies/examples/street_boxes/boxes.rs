//! Boxes of labeled sweeps.

use serde_json::Value;
use std::path::Path;

/// What a box contains.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Label {
    Vehicle,
    Person,
    /// A class whose points may be vehicles or pedestrians of the class table: cyclists, riders, motorcycles.
    Ignored,
}

/// A box in the frame of the sweep, turned about z.
pub struct Cuboid {
    pub label: Label,
    center: [f32; 3],
    /// Sides along the turned x, y and z, m.
    sides: [f32; 3],
    yaw: f32,
}

impl Cuboid {
    pub fn contains(&self, p: [f32; 3]) -> bool {
        let [x, y, z] = std::array::from_fn(|axis| p[axis] - self.center[axis]);
        let (sin, cos) = self.yaw.sin_cos();
        let turned = [cos * x + sin * y, cos * y - sin * x, z];
        turned.iter().zip(self.sides).all(|(at, side)| 2.0 * at.abs() <= side)
    }
}

/// The boxes of a sweep: the text file of `PandaSet` or the JSON file of `SUSTechPOINTS` of the same name. `None` if the file is not a
/// sweep with boxes.
pub fn read(sweep: &Path) -> Option<Vec<Cuboid>> {
    let read = |extension: &str| std::fs::read_to_string(sweep.with_extension(extension)).ok();
    match sweep.extension()?.to_str()? {
        "bin" => Some(from_text(&read("txt")?)),
        "pcd" => Some(from_json(&read("json")?)),
        _ => None,
    }
}

/// Lines of class, a number, center, sides and yaw. Boxes of other classes are left out.
fn from_text(text: &str) -> Vec<Cuboid> {
    let cuboid = |(number, line): (usize, &str)| {
        let words: Vec<&str> = line.split_whitespace().collect();
        assert!(
            words.len() >= 9,
            "line {}: {} words; must be class, number, center, sides and yaw",
            number + 1,
            words.len()
        );
        let at = |idx: usize| words[idx].parse().unwrap_or_else(|_| panic!("line {}: {:?}", number + 1, words[idx]));
        let label = label(words[0])?;
        Some(Cuboid { label, center: [at(2), at(3), at(4)], sides: [at(5), at(6), at(7)], yaw: at(8) })
    };
    text.lines().enumerate().filter_map(cuboid).collect()
}

fn from_json(text: &str) -> Vec<Cuboid> {
    let list: Value = serde_json::from_str(text).expect("the boxes are JSON");
    let cuboid = |object: &Value| {
        let number = |of: &str, axis: &str| object["psr"][of][axis].as_f64().expect("psr has numbers") as f32;
        let three = |of: &str| ["x", "y", "z"].map(|axis| number(of, axis));
        let label = label(object["obj_type"].as_str().expect("has a type"))?;
        Some(Cuboid { label, center: three("position"), sides: three("scale"), yaw: number("rotation", "z") })
    };
    list.as_array().expect("is a list").iter().filter_map(cuboid).collect()
}

fn label(name: &str) -> Option<Label> {
    match name {
        "TYPE_VEHICLE"
        | "Car"
        | "Van"
        | "Truck"
        | "Bus"
        | "Pickup_Truck"
        | "Medium-sized_Truck"
        | "Semi-truck"
        | "Towed_Object"
        | "Other_Vehicle_-_Construction_Vehicle" => Some(Label::Vehicle),
        "TYPE_PEDESTRIAN" | "Pedestrian" | "Pedestrian_with_Object" => Some(Label::Person),
        "TYPE_CYCLIST" | "Rider" | "Bicycle" | "BicycleRider" | "Motorcycle" | "MotorcyleRider"
        | "Motorized_Scooter" => Some(Label::Ignored),
        _ => None,
    }
}
