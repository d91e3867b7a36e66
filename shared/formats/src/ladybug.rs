//! The calibration file of a Ladybug, as its maker delivers it with every serial number (`.cal`, text): how its cameras sit in its
//! housing, and each lens as two splines from an ideal (*rectified*) image to the sensor (*distorted*). The splines back, the sphere of
//! the panorama and the falloff of the light are skipped: inverses are computed here, and panoramas are not made.

use geometry::{Isometry3, Pose, SplineSurface, SplineWarp, Translation3, UnitQuaternion};
use std::collections::BTreeMap;
use std::str::FromStr;

/// The whole file.
#[derive(Clone, Debug, PartialEq)]
pub struct LadybugCalibration {
    /// Serial number.
    pub serial: String,
    /// Cameras by index: five around, one up.
    pub cameras: Vec<LadybugCamera>,
}

/// One of its cameras.
#[derive(Clone, Debug, PartialEq)]
pub struct LadybugCamera {
    /// Mounting in the housing: x forward through camera 0, z up, m.
    pub ladybug_from_camera: Pose,
    /// Lens.
    pub lens: SplineWarp,
    /// Places in the housing's frame, m, with where they are in the lens' ideal image, px: five of them, for checks.
    pub pairs: Vec<([f64; 3], [f64; 2])>,
}

/// What is wrong, and where.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("line {line}: {rule}")]
pub struct LadybugError {
    /// From 1.
    pub line: usize,
    /// What was found and what must be there.
    pub rule: String,
}

/// A camera's block, before its splines are known.
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
        let (mut serial, mut resolution, mut blocks, mut warps) = (String::new(), None, Vec::new(), BTreeMap::new());
        while let Some((line, words)) = lines.next() {
            let (key, rest) = words.split_once(char::is_whitespace).unwrap_or((words, ""));
            match key {
                "SerialNumber" => rest.trim().clone_into(&mut serial),
                "Resolution" => resolution = Some(of_length::<2>(line, key, &numbers(line, rest)?)?),
                "BeginCamera" => blocks.push(Block { line, entries: entries(line, &mut lines, "EndCamera")? }),
                "BeginWarp" => {
                    let (id, surface) = warp(line, &entries(line, &mut lines, "EndWarp")?)?;
                    warps.insert(id, surface);
                }
                _ => {}
            }
        }
        let [width, height] = resolution.ok_or_else(|| error(1, "no Resolution: no calibration of a Ladybug"))?;
        if !(1.0..=32_768.0).contains(&width) || !(1.0..=32_768.0).contains(&height) {
            return Err(error(1, format!("Resolution {width} {height} must be 1 to 32768 px a side")));
        }
        if blocks.is_empty() {
            return Err(error(1, "no camera"));
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
            warp.and_then(Clone::clone)
                .ok_or_else(|| error(self.line, format!("spline {id} is missing or not a surface with even knots")))
        };
        // Shares of the image from its rim become px, the upper left pixel's center 0.
        let px = |share: [f64; 2]| [0, 1].map(|axis| share[axis] * size[axis] - 0.5);
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
        let (line, values) = self.entries.get(key).ok_or_else(|| error(self.line, format!("camera without {key}")))?;
        of_length(*line, key, values)
    }
}

/// Of the map from ideal to real image, where it is one that this program has.
type Warp = Option<SplineSurface>;

/// A spline, and its number. Those with uneven knots are none that cameras here need, until a camera does.
fn warp(line: usize, entries: &BTreeMap<String, (usize, Vec<f64>)>) -> Result<(usize, Warp), LadybugError> {
    let get = |key: &str| entries.get(key).ok_or_else(|| error(line, format!("spline without {key}")));
    let (at, id) = get("Id")?;
    let [id] = of_length(*at, "Id", id)?;
    let (at, counts) = get("NumberCoefs")?;
    let counts = of_length::<2>(*at, "NumberCoefs", counts)?;
    let (at, coefficients) = get("Coefs")?;
    let [n_rows, n_columns] = counts.map(|n| n as usize);
    if n_rows.checked_mul(n_columns) != Some(coefficients.len()) || n_columns == 0 {
        return Err(error(*at, format!("{} coefficients; must be {n_rows} times {n_columns}", coefficients.len())));
    }
    let is_even = is_even(&get("KnotsX")?.1, n_rows) && is_even(&get("KnotsY")?.1, n_columns);
    let rows: Vec<Vec<f64>> = coefficients.chunks_exact(n_columns).map(<[f64]>::to_vec).collect();
    Ok((id as usize, SplineSurface::try_from(rows).ok().filter(|_| is_even)))
}

/// Whether the knots are 0 four times, even steps, 1 four times, to the file's six digits.
fn is_even(knots: &[f64], n: usize) -> bool {
    let knot = |i: usize| (i.max(3) - 3).min(n.saturating_sub(3)) as f64 / n.saturating_sub(3).max(1) as f64;
    knots.len() == n + 4 && knots.iter().enumerate().all(|(i, found)| (found - knot(i)).abs() < 2e-6)
}

/// Everything up to `end`: keys with their lines and numbers; numbers on lines of their own belong to the key before.
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
    Err(error(begin, format!("no {end} to the end of the file")))
}

fn numbers(line: usize, words: &str) -> Result<Vec<f64>, LadybugError> {
    let number = |word: &str| {
        let value = word.parse::<f64>().ok().filter(|value| value.is_finite());
        value.ok_or_else(|| error(line, format!("{word:?} must be a number")))
    };
    words.split_whitespace().map(number).collect()
}

fn of_length<const N: usize>(line: usize, key: &str, values: &[f64]) -> Result<[f64; N], LadybugError> {
    values.try_into().map_err(|_| error(line, format!("{key} has {} numbers; must be {N}", values.len())))
}

fn error(line: usize, rule: impl Into<String>) -> LadybugError {
    LadybugError { line, rule: rule.into() }
}
