//! Streets with known objects, and the stage on a test bench.

pub mod lidar;

use instance::{InstanceStage, Settings};
use messages::{ClassHeader, ClassId, ClassRow, ClassTopic, PoseRow, SubmapHeader, SubmapPoint, SubmapTopic};
use stage::testing::{Bench, context};
use std::path::Path;

/// Points, their classes and the numbers of their objects; 0 = no object.
#[derive(Clone, Default)]
pub struct Street {
    pub points: Vec<SubmapPoint>,
    pub classes: Vec<ClassRow>,
    pub truth: Vec<u32>,
}

impl Street {
    pub fn push(&mut self, [x, y, z]: [f32; 3], class: ClassId, thing: u32) {
        self.points.push(SubmapPoint { x, y, z, ..SubmapPoint::default() });
        self.classes.push(ClassRow { class_id: class as u8, score: 255 });
        self.truth.push(thing);
    }

    /// A road of 30 m x 14 m with a slope of 10 %, one point every 10 cm, none inside the boxes of `holes`.
    pub fn road(holes: &[[f32; 4]]) -> Self {
        let mut street = Self::default();
        for (row, col) in (0..300_u16).flat_map(|row| (0..140_u16).map(move |col| (row, col))) {
            let x = f32::from(row) * 0.1 + 0.05;
            let y = f32::from(col) * 0.1 + 0.05;
            if !holes.iter().any(|&[x0, y0, x1, y1]| x > x0 && x < x1 && y > y0 && y < y1) {
                street.push([x, y, slope(x)], ClassId::Road, 0);
            }
        }
        street
    }

    /// Adds the outline of a box: points on a spiral of 50 turns up its sides.
    pub fn object(&mut self, [x0, y0, x1, y1]: [f32; 4], heights: [f32; 2], n: usize, class: ClassId, thing: u32) {
        let perimeter = 2.0 * (x1 - x0 + y1 - y0);
        for i in 0..n {
            let share = i as f32 / n as f32;
            let along = (share * 50.0).fract() * perimeter;
            let dx = x1 - x0;
            let dy = y1 - y0;
            let (x, y) = match along {
                a if a < dx => (x0 + a, y0),
                a if a < dx + dy => (x1, y0 + a - dx),
                a if a < 2.0 * dx + dy => (x1 - (a - dx - dy), y1),
                a => (x0, y1 - (a - 2.0 * dx - dy)),
            };
            let above = heights[0] + share * (heights[1] - heights[0]);
            self.push([x, y, slope(x) + above], class, thing);
        }
    }
}

pub fn slope(x: f32) -> f32 {
    0.1 * x
}

pub const CARS: [[f32; 4]; 3] = [[2.0, 2.0, 6.4, 3.8], [7.0, 2.0, 11.4, 3.8], [20.0, 9.0, 24.4, 10.8]];
pub const PEOPLE: [[f32; 4]; 2] = [[14.0, 6.0, 14.5, 6.5], [15.2, 6.0, 15.7, 6.5]];

/// Three cars, two of them 60 cm apart, and two people 70 cm apart.
pub fn street() -> Street {
    let mut street = Street::road(&[CARS, [PEOPLE[0], PEOPLE[1], CARS[0]]].concat());
    for (number, car) in (1..).zip(CARS) {
        street.object(car, [0.2, 1.5], 3000, ClassId::Vehicles, number);
    }
    for (number, person) in (4..).zip(PEOPLE) {
        street.object(person, [0.0, 1.8], 300, ClassId::Pedestrian, number);
    }
    street
}

/// The header of a submap with this position and no rotation.
pub fn at(translation: [f64; 3]) -> SubmapHeader {
    let odom_from_submap = PoseRow { translation, rotation: [0.0, 0.0, 0.0, 1.0] };
    SubmapHeader { odom_from_submap, ..SubmapHeader::default() }
}

pub fn bench(settings: &Settings) -> Bench<InstanceStage> {
    Bench::new(settings, &context(Path::new("/nowhere"))).expect("builds")
}

pub fn send(bench: &mut Bench<InstanceStage>, street: &Street) {
    bench.send::<SubmapTopic>(0, at([0.0; 3]), street.points.clone());
    bench.send::<ClassTopic>(0, ClassHeader::default(), street.classes.clone());
}
