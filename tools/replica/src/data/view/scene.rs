//! `scene.json`: everything that the page shows except the points. Coordinates are in the frame of the points.

use crate::data::deliver::frame::ChosenFrame;
use messages::columns::{COLUMNS, ColumnField};
use messages::{ClassId, MaterialId};
use pictures::class_color::class_color;
use pictures::material_color::material_color;
use serde::{Deserialize, Serialize};
use surveying::crs::CrsError;
use surveying::objects::ObjectSummary;
use surveying::{RunFolder, TargetFrame};

/// Largest number of vertices of the path: a screen has fewer pixels in a row.
const MAX_VERTICES: usize = 20_000;

/// Everything that is shown except the points.
#[derive(Serialize)]
pub struct Scene {
    /// Version of the format.
    version: u32,
    title: String,
    /// Whether the points come from `live.json` and grow.
    is_live: bool,
    /// Coordinates in words.
    coordinates: String,
    /// Names and colors of the values of the field `class`.
    classes: Vec<SceneValue>,
    /// Names and colors of the values of the field `material`.
    material_table: Vec<SceneValue>,
    /// Positions of the vehicle, m.
    path: Vec<[f64; 3]>,
    pub images: Vec<SceneImage>,
    objects: Vec<SceneObject>,
    /// Reference spectra.
    materials: Vec<SceneMaterial>,
    /// The fields of the points, as the table of columns declares them.
    columns: Vec<&'static ColumnField>,
}

#[derive(Serialize)]
struct SceneValue {
    id: u8,
    name: &'static str,
    /// Color in sRGB.
    color: [u8; 3],
}

/// An exposure of a camera.
#[derive(Serialize)]
pub struct SceneImage {
    /// Name of the picture file.
    pub file: String,
    pub camera: String,
    /// Position of the camera, m.
    pub position: [f64; 3],
    /// A point one metre in front of the camera, m.
    pub ahead: [f64; 3],
}

/// An object and the box around it.
#[derive(Serialize, Deserialize)]
pub struct SceneObject {
    id: i64,
    class: String,
    n_points: u64,
    score: Option<f64>,
    /// Corners of the box: four below, then four above, m.
    corners: Vec<[f64; 3]>,
}

#[derive(Serialize)]
struct SceneMaterial {
    name: String,
    /// First wavelength, nm.
    first: f32,
    /// Step of the wavelength, nm.
    step: f32,
    /// Reflectances, 0 to 1.
    reflectances: Vec<f32>,
}

impl Scene {
    /// A scene with only points.
    pub fn new(title: String) -> Self {
        let class =
            |class: &ClassId| SceneValue { id: *class as u8, name: class.name(), color: class_color(*class as u8) };
        let material = |material: &MaterialId| {
            let id = *material as u8;
            SceneValue { id, name: material.name(), color: material_color(id) }
        };
        Self {
            version: 1,
            title,
            is_live: false,
            coordinates: String::new(),
            classes: ClassId::ALL.iter().map(class).collect(),
            material_table: MaterialId::ALL.iter().map(material).collect(),
            path: Vec::new(),
            images: Vec::new(),
            objects: Vec::new(),
            materials: town::Material::ALL.iter().copied().map(SceneMaterial::from_material).collect(),
            columns: COLUMNS.iter().flat_map(|column| column.fields).collect(),
        }
    }

    /// A scene of points that grow.
    pub fn live(title: String) -> Self {
        let coordinates = "frame of the odometry, m: final poses are known at the end of the run".to_owned();
        Self { is_live: true, coordinates, ..Self::new(title) }
    }

    /// Adds path and objects of a run.
    pub fn add_run(
        &mut self,
        run: &RunFolder,
        frame: &ChosenFrame<'_>,
        objects: Vec<SceneObject>,
    ) -> Result<(), CrsError> {
        self.coordinates = frame.target.description();
        let poses = run.trajectory.poses();
        let step = poses.len().div_ceil(MAX_VERTICES).max(1);
        let vertices = poses.iter().step_by(step);
        self.path = vertices
            .map(|(_, pose)| frame.target.from_local(&pose.translation.vector.into()))
            .collect::<Result<_, _>>()?;
        self.objects = objects;
        Ok(())
    }
}

impl SceneObject {
    /// An object of the clouds in the coordinates of the points.
    pub fn from_summary(object: &ObjectSummary, frame: &TargetFrame<'_>) -> Result<Self, CrsError> {
        let corners = [object.low_m, object.high_m].into_iter().flat_map(|z| object.corners().map(|[x, y]| [x, y, z]));
        Ok(Self {
            id: object.id,
            class: object.class.to_owned(),
            n_points: object.n_points,
            score: object.score,
            corners: corners.map(|corner| frame.from_cloud(corner)).collect::<Result<_, _>>()?,
        })
    }
}

impl SceneMaterial {
    fn from_material(material: town::Material) -> Self {
        // Three digits exceed the accuracy of the spectra.
        let rounded = |value: &f32| (value * 1000.0).round() / 1000.0;
        Self {
            name: words(&format!("{material:?}")),
            first: town::spectrum::FIRST_NM,
            step: town::spectrum::STEP_NM,
            reflectances: material.spectrum().values().iter().map(rounded).collect(),
        }
    }
}

/// Words of a camel-case name: `BrickYellow` as "brick yellow".
fn words(name: &str) -> String {
    let mut words = String::new();
    for letter in name.chars() {
        if letter.is_uppercase() && !words.is_empty() {
            words.push(' ');
        }
        words.extend(letter.to_lowercase());
    }
    words
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn materials_have_names_in_words_and_reflectances() {
        assert_eq!(words("BrickYellow"), "brick yellow");
        let scene = serde_json::to_value(Scene::new("a".to_owned())).expect("encodes");
        let materials = scene["materials"].as_array().expect("a list");
        let grass = materials.iter().find(|material| material["name"] == "grass").expect("is one");
        let at = |nm: usize| grass["reflectances"][(nm - 400) / 10].as_f64().expect("a number");
        assert!(at(800) > 3.0 * at(670), "the red edge: {} {}", at(670), at(800));
        assert_eq!(scene["classes"].as_array().map(Vec::len), Some(ClassId::ALL.len()));
        assert_eq!(scene["material_table"].as_array().map(Vec::len), Some(MaterialId::ALL.len()));
    }
}
