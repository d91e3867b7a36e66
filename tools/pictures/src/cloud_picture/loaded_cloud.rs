//! A PLY cloud in memory, with the columns that a table and a picture need.

use super::color_by::ShownField;
use super::spectra;
use formats::ply::Vertices;
use messages::UNSEEN;
use std::path::Path;

/// The points of one PLY file. A column that the file does not have is `None`.
pub struct LoadedCloud {
    axes: [Vec<f64>; 3],
    /// Position of the lidar at each point.
    lidar: Option<[Vec<f64>; 3]>,
    /// Color, sRGB. The inner `None` marks a point that no camera saw.
    color: Option<Vec<Option<[u8; 3]>>>,
    class: Option<Vec<u8>>,
    material: Option<Vec<u8>>,
    instance: Option<Vec<i64>>,
    intensity: Option<Vec<f32>>,
    time_s: Option<Vec<f64>>,
    /// Stated standard deviation of the horizontal position of the submap, m.
    sigma_m: Option<f64>,
    /// Reflectance of one band; NaN for points without a reflectance.
    band: Option<Vec<f32>>,
    /// Values of the requested field.
    field: Option<Vec<f64>>,
}

impl LoadedCloud {
    /// Reads a PLY file.
    pub fn load(path: &Path) -> anyhow::Result<Self> {
        Self::from_vertices(&Vertices::load(path)?)
    }

    /// Reads a PLY file with the reflectances of the band nearest to this wavelength, if its file of spectra exists.
    pub fn load_with_band(path: &Path, band_nm: f64) -> anyhow::Result<Self> {
        let cloud = Self::load(path)?;
        let band = spectra::band(path, cloud.len(), band_nm)?;
        Ok(Self { band, ..cloud })
    }

    /// Reads a PLY file with the values of a field, if the cloud has it.
    pub fn load_with_field(path: &Path, field: &ShownField) -> anyhow::Result<Self> {
        let vertices = Vertices::load(path)?;
        let values = vertices.has(&field.property).then(|| vertices.f64s(&field.property)).transpose()?;
        Ok(Self { field: values, ..Self::from_vertices(&vertices)? })
    }

    /// The columns of a cloud.
    pub fn from_vertices(v: &Vertices) -> anyhow::Result<Self> {
        let named = |names: [&'static str; 3]| names.into_iter().find(|name| v.has(name));
        let color = ["red", "green", "blue"].iter().all(|name| v.has(name)).then(|| color(v)).transpose()?;
        let lidar = ["x_lidar_position", "y_lidar_position", "z_lidar_position"];
        Ok(Self {
            axes: axes(v, ["x", "y", "z"])?,
            lidar: lidar.iter().all(|name| v.has(name)).then(|| axes(v, lidar)).transpose()?,
            color,
            class: named(["semantic", "class", "label"]).map(|name| v.u8s(name)).transpose()?,
            material: v.has("material").then(|| v.u8s("material")).transpose()?,
            instance: named(["instance", "ins", "instance_id"]).map(|name| v.i64s(name)).transpose()?,
            intensity: named(["intensity", "reflectance", "scalar_Intensity"]).map(|name| v.f32s(name)).transpose()?,
            time_s: named(["timestamp", "GPS_time", "time"]).map(|name| v.f64s(name)).transpose()?,
            sigma_m: sigma_m(v.infos()),
            band: None,
            field: None,
        })
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.axes[0].len()
    }

    /// Whether there are no points.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
    /// x y z, m.
    pub fn position(&self, point_idx: usize) -> [f64; 3] {
        self.axes.each_ref().map(|axis| axis[point_idx])
    }
    /// x y z of the lidar at the time of the return, m.
    pub fn lidar_position(&self, point_idx: usize) -> Option<[f64; 3]> {
        self.lidar.as_ref().map(|axes| axes.each_ref().map(|axis| axis[point_idx]))
    }
    /// Whether the file has colors.
    pub fn has_color(&self) -> bool {
        self.color.is_some()
    }
    /// sRGB of the point, if a camera saw it.
    pub fn color(&self, point_idx: usize) -> Option<[u8; 3]> {
        self.color.as_ref().and_then(|color| color[point_idx])
    }
    /// Class of each point.
    pub fn classes(&self) -> Option<&[u8]> {
        self.class.as_deref()
    }
    /// Material of each point, 0 = unknown.
    pub fn materials(&self) -> Option<&[u8]> {
        self.material.as_deref()
    }
    /// Instance of each point, 0 = none.
    pub fn instances(&self) -> Option<&[i64]> {
        self.instance.as_deref()
    }
    /// Intensity of each return.
    pub fn intensities(&self) -> Option<&[f32]> {
        self.intensity.as_deref()
    }
    /// Value of each point in the requested field; see [`LoadedCloud::load_with_field`].
    pub fn field(&self) -> Option<&[f64]> {
        self.field.as_deref()
    }
    /// Stated standard deviation of the horizontal position, m.
    pub fn sigma_m(&self) -> Option<f64> {
        self.sigma_m
    }
    /// Reflectance of each point in the band, NaN if unknown; see [`LoadedCloud::load_with_band`].
    pub fn band(&self) -> Option<&[f32]> {
        self.band.as_deref()
    }
    /// Time of each return, s; the epoch depends on the file.
    pub fn times_s(&self) -> Option<&[f64]> {
        self.time_s.as_deref()
    }
}

/// The deviation in the line `standard_deviation position_m 3.260 ...`.
fn sigma_m(infos: &[String]) -> Option<f64> {
    let words = infos.iter().find_map(|info| info.strip_prefix("standard_deviation position_m "))?;
    words.split_whitespace().next()?.parse().ok()
}

fn axes(v: &Vertices, names: [&str; 3]) -> anyhow::Result<[Vec<f64>; 3]> {
    let [x, y, z] = names;
    Ok([v.f64s(x)?, v.f64s(y)?, v.f64s(z)?])
}

fn color(v: &Vertices) -> anyhow::Result<Vec<Option<[u8; 3]>>> {
    let r = v.u8s("red")?;
    let g = v.u8s("green")?;
    let b = v.u8s("blue")?;
    let camera = v.has("camera").then(|| v.u8s("camera")).transpose()?;
    let is_seen = |i: usize| camera.as_ref().is_none_or(|camera| camera[i] != UNSEEN);
    Ok((0..r.len()).map(|i| is_seen(i).then(|| [r[i], g[i], b[i]])).collect())
}
