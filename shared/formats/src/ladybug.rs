//! Calibration files of Ladybug panoramic cameras (`.cal`, text), delivered by the manufacturer for each serial number. A file
//! contains the poses of the cameras in the housing, and for each lens two splines from an ideal (*rectified*) image to the sensor
//! (*distorted*). Inverse splines, panorama sphere and vignetting are skipped: inverses are computed numerically, and no panoramas
//! are made.

use geometry::{Isometry3, Pose, SplineSurface, SplineWarp, Translation3, UnitQuaternion};
use std::collections::BTreeMap;
use std::str::FromStr;

/// Content of a file.
#[derive(Clone, Debug, PartialEq)]
pub struct LadybugCalibration {
    /// Serial number.
    pub serial: String,
    /// Cameras by index: five around, one up.
    pub cameras: Vec<LadybugCamera>,
}

/// One camera of the panoramic camera.
#[derive(Clone, Debug, PartialEq)]
pub struct LadybugCamera {
    /// Pose in the housing: x forward through camera 0, z up, m.
    pub ladybug_from_camera: Pose,
    /// Lens.
    pub lens: SplineWarp,
    /// Five reference points for checks: position in the frame of the housing, m, and pixel in the ideal image.
    pub pairs: Vec<([f64; 3], [f64; 2])>,
}

/// Error of an invalid line of a file.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("line {line}: {fault}")]
pub struct LadybugError {
    /// Line, from 1.
    pub line: usize,
    /// The value found and the value expected.
    pub fault: LadybugFault,
}

/// Fault of a line.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum LadybugFault {
    /// The file is not a Ladybug calibration.
    #[error("not a Ladybug calibration: no Resolution")]
    NoResolution,
    /// The size of the images is impossible.
    #[error("Resolution {width} {height} must be 1 to 32768 px a side")]
    Resolution {
        /// Width found, px.
        width: f64,
        /// Height found, px.
        height: f64,
    },
    /// No camera is calibrated.
    #[error("the file has no camera")]
    NoCamera,
    /// A camera has no usable spline.
    #[error("spline {0} is missing or not a surface with even knots")]
    Spline(f64),
    /// A block has no entry of this name.
    #[error("the {block} has no {key}")]
    NoEntry {
        /// Camera or spline.
        block: &'static str,
        /// Name of the entry.
        key: String,
    },
    /// The coefficients of a spline do not match their numbers.
    #[error("{found} coefficients; expected {n_rows} times {n_columns}")]
    Coefficients {
        /// Number of coefficients found.
        found: usize,
        /// Number of rows that the file states.
        n_rows: usize,
        /// Number of columns that the file states.
        n_columns: usize,
    },
    /// A block does not end.
    #[error("no {0} up to the end of the file")]
    NoEnd(String),
    /// A word is not a finite number.
    #[error("{0:?} is not a number")]
    Number(String),
    /// An entry has a wrong number of values.
    #[error("{key} has {found} numbers; expected {expected}")]
    Length {
        /// Name of the entry.
        key: String,
        /// Number of values found.
        found: usize,
        /// Number of values required.
        expected: usize,
    },
}

/// Entries of a camera, before its splines are known.
struct Block {
    line: usize,
    entries: BTreeMap<String, (usize, Vec<f64>)>,
}

const CORNERS: [&str; 5] = ["Center", "TopLeft", "BottomLeft", "TopRight", "BottomRight"];

impl FromStr for LadybugCalibration {
    type Err = LadybugError;

    fn from_str(text: &str) -> Result<Self, LadybugError> {
        let mut lines =
            (1..).zip(text.lines().map(str::trim)).filter(|(_, line)| !line.is_empty() && !line.starts_with('#'));
        let mut serial = String::new();
        let mut resolution = None;
        let mut blocks = Vec::new();
        let mut warps = BTreeMap::new();
        while let Some((line, words)) = lines.next() {
            let (key, rest) = words.split_once(char::is_whitespace).unwrap_or((words, ""));
            match key {
                "SerialNumber" => rest.trim().clone_into(&mut serial),
                "Resolution" => resolution = Some(to_array::<2>(line, key, &numbers(line, rest)?)?),
                "BeginCamera" => blocks.push(Block { line, entries: entries(line, &mut lines, "EndCamera")? }),
                "BeginWarp" => {
                    let (id, surface) = warp(line, &entries(line, &mut lines, "EndWarp")?)?;
                    warps.insert(id, surface);
                }
                _ => {}
            }
        }
        let [width, height] = resolution.ok_or_else(|| error(1, LadybugFault::NoResolution))?;
        if !(1.0..=32_768.0).contains(&width) || !(1.0..=32_768.0).contains(&height) {
            return Err(error(1, LadybugFault::Resolution { width, height }));
        }
        if blocks.is_empty() {
            return Err(error(1, LadybugFault::NoCamera));
        }
        let cameras = blocks.iter().map(|block| block.camera([width, height], &warps)).collect::<Result<_, _>>()?;
        Ok(Self { serial, cameras })
    }
}

impl Block {
    fn camera(&self, size: [f64; 2], warps: &BTreeMap<usize, Warp>) -> Result<LadybugCamera, LadybugError> {
        let [fx, fy] = self.get("focalLength")?;
        let [rx, ry, rz, x, y, z] = self.get("CamToLadybugEulerZYX")?;
        let [warp_u, warp_v] = self.get::<2>("RectifiedSpline")?.map(|id| (id, warps.get(&(id as usize))));
        let found = |(id, warp): (f64, Option<&Warp>)| {
            warp.and_then(Clone::clone).ok_or_else(|| error(self.line, LadybugFault::Spline(id)))
        };
        // Positions are fractions of the image size from its edge; the center of the upper left pixel is 0.
        let px = |fraction: [f64; 2]| [0, 1].map(|axis| fraction[axis] * size[axis] - 0.5);
        let pair = |name: &&str| {
            let [x, y, z, u, v] = self.get(name)?;
            Ok(([x, y, z], px([u, v])))
        };
        let pairs = CORNERS.iter().map(pair).collect::<Result<Vec<_>, LadybugError>>()?;
        let [cx, cy] = pairs[0].1;
        // R = Rz Ry Rx.
        let rotation = UnitQuaternion::from_euler_angles(rx, ry, rz);
        Ok(LadybugCamera {
            ladybug_from_camera: Isometry3::from_parts(Translation3::new(x, y, z), rotation),
            lens: SplineWarp {
                width: size[0] as u32,
                height: size[1] as u32,
                fx: fx * size[0],
                fy: fy * size[1],
                cx,
                cy,
                warp_u: found(warp_u)?,
                warp_v: found(warp_v)?,
            },
            pairs,
        })
    }

    fn get<const N: usize>(&self, key: &str) -> Result<[f64; N], LadybugError> {
        let (line, values) = self
            .entries
            .get(key)
            .ok_or_else(|| error(self.line, LadybugFault::NoEntry { block: "camera", key: key.to_owned() }))?;
        to_array(*line, key, values)
    }
}

/// A spline of the map from ideal to real image. `None` for splines with uneven knots, which are not supported.
type Warp = Option<SplineSurface>;

/// Number and surface of a spline. Splines that no camera uses may have uneven knots.
fn warp(line: usize, entries: &BTreeMap<String, (usize, Vec<f64>)>) -> Result<(usize, Warp), LadybugError> {
    let get = |key: &str| {
        entries.get(key).ok_or_else(|| error(line, LadybugFault::NoEntry { block: "spline", key: key.to_owned() }))
    };
    let (at, id) = get("Id")?;
    let [id] = to_array(*at, "Id", id)?;
    let (at, counts) = get("NumberCoefs")?;
    let counts = to_array::<2>(*at, "NumberCoefs", counts)?;
    let (at, coefficients) = get("Coefs")?;
    let [n_rows, n_columns] = counts.map(|n| n as usize);
    if n_rows.checked_mul(n_columns) != Some(coefficients.len()) || n_columns == 0 {
        return Err(error(*at, LadybugFault::Coefficients { found: coefficients.len(), n_rows, n_columns }));
    }
    let is_even = is_even(&get("KnotsX")?.1, n_rows) && is_even(&get("KnotsY")?.1, n_columns);
    let rows: Vec<Vec<f64>> = coefficients.chunks_exact(n_columns).map(<[f64]>::to_vec).collect();
    Ok((id as usize, SplineSurface::try_from(rows).ok().filter(|_| is_even)))
}

/// Whether the knots are four times 0, even steps, four times 1, within the precision of the file (six digits).
fn is_even(knots: &[f64], n: usize) -> bool {
    let knot = |i: usize| (i.max(3) - 3).min(n.saturating_sub(3)) as f64 / n.saturating_sub(3).max(1) as f64;
    knots.len() == n + 4 && knots.iter().enumerate().all(|(i, found)| (found - knot(i)).abs() < 2e-6)
}

/// Entries up to `end`: keys with their lines and numbers. Numbers on separate lines belong to the previous key.
fn entries<'a>(
    begin: usize,
    lines: &mut impl Iterator<Item = (usize, &'a str)>,
    end: &str,
) -> Result<BTreeMap<String, (usize, Vec<f64>)>, LadybugError> {
    let mut entries = BTreeMap::<String, (usize, Vec<f64>)>::new();
    let mut key = String::new();
    for (line, words) in lines {
        if words == end {
            return Ok(entries);
        }
        let has_key =
            words.starts_with(|c: char| c.is_ascii_alphabetic() || c.is_ascii_digit() && words[1..].starts_with('D'));
        let values = match words.split_once(char::is_whitespace).filter(|_| has_key) {
            Some((found, rest)) => {
                found.clone_into(&mut key);
                rest
            }
            None if has_key => {
                words.clone_into(&mut key);
                ""
            }
            None => words,
        };
        let values = numbers(line, values)?;
        entries.entry(key.clone()).or_insert((line, Vec::new())).1.extend(values);
    }
    Err(error(begin, LadybugFault::NoEnd(end.to_owned())))
}

fn numbers(line: usize, words: &str) -> Result<Vec<f64>, LadybugError> {
    let number = |word: &str| {
        let value = word.parse::<f64>().ok().filter(|value| value.is_finite());
        value.ok_or_else(|| error(line, LadybugFault::Number(word.to_owned())))
    };
    words.split_whitespace().map(number).collect()
}

fn to_array<const N: usize>(line: usize, key: &str, values: &[f64]) -> Result<[f64; N], LadybugError> {
    let fault = || LadybugFault::Length { key: key.to_owned(), found: values.len(), expected: N };
    values.try_into().map_err(|_| error(line, fault()))
}

fn error(line: usize, fault: LadybugFault) -> LadybugError {
    LadybugError { line, fault }
}
