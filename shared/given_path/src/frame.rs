//! Places and attitudes of a file as poses in the world frame.

use crate::decode::{RawAttitude, RawPath, RawPose};
use drive::manifest::{HeadingSense, TrajectoryEntry};
use formats::pose_table::PlaceKind;
use geometry::{Geodetic, Isometry3, LocalFrame, Point3, Pose, Projection, Translation3, UnitQuaternion, Vector3};
use std::f64::consts::FRAC_PI_2;

/// Converts poses of a file to poses of its reference point in the world.
pub(crate) struct WorldFrame {
    places: Places,
    heading: HeadingSense,
    geoid_m: f64,
    /// East, north and up at the origin of the world; `None`: not georeferenced.
    pub local: Option<LocalFrame>,
}

enum Places {
    Geodetic,
    Projected(Box<Projection>),
    Local,
}

/// Largest local coordinate, m: farther points lose millimetres in clouds of f32.
const MAX_LOCAL_M: f64 = 100_000.0;
/// Step with which the axes of a projection are measured, m: coordinates have 1e-9 m of noise.
const STEP_M: f64 = 10.0;

impl WorldFrame {
    /// `origin` is the origin of the drive's world, if it has one; otherwise the first pose becomes the origin.
    pub fn new(raw: &RawPath, entry: &TrajectoryEntry, origin: Option<Geodetic>) -> Result<Self, String> {
        let places = places(raw.place, entry)?;
        if raw.is_above_geoid && entry.geoid_m.is_none() {
            return Err("heights are above the geoid and the columns have no undulation; set trajectory.geoid_m".into());
        }
        let mut frame = Self {
            places,
            heading: entry.heading,
            geoid_m: entry.geoid_m.unwrap_or(0.0),
            local: origin.map(LocalFrame::new),
        };
        let stated = entry.origin.and_then(|[lat, lon, height]| Geodetic::new(lat, lon, height));
        if let Places::Local = frame.places {
            let far = raw.poses.iter().map(|pose| pose.place[0].abs().max(pose.place[1].abs())).fold(0.0, f64::max);
            if far > MAX_LOCAL_M {
                return Err(format!(
                    "local coordinates of {far:.0} m look like map coordinates; set trajectory.frame to their UTM zone, such as \"EPSG:32632\""
                ));
            }
            frame.local = stated.map(LocalFrame::new);
        } else if stated.is_some() {
            return Err(
                "trajectory.origin is the origin of a local frame; remove it, or set trajectory.frame = \"local\""
                    .into(),
            );
        }
        if let (None, false, Some(first)) = (&frame.local, matches!(frame.places, Places::Local), raw.poses.first()) {
            frame.local = Some(LocalFrame::new(frame.geodetic(first)?));
        }
        Ok(frame)
    }

    fn geodetic(&self, pose: &RawPose) -> Result<Geodetic, String> {
        let [a, b, height] = pose.place;
        let height = height + self.geoid_m;
        match &self.places {
            Places::Projected(projection) => projection.unproject([a, b, height]).map_err(|error| error.to_string()),
            Places::Geodetic | Places::Local => Geodetic::new(a, b, height).ok_or_else(|| {
                format!("latitude {a}, longitude {b}, height {height} is not a position in degrees and m")
            }),
        }
    }

    /// The pose of the reference point, with axes forward, left and up.
    pub fn world_from_reference(&self, pose: &RawPose) -> Result<Pose, String> {
        let [x, y, z] = pose.place;
        let Some(local) = self.local.as_ref().filter(|_| !matches!(self.places, Places::Local)) else {
            let position = Translation3::new(x, y, z + self.geoid_m);
            return Ok(Isometry3::from_parts(position, self.rotation(&pose.attitude)));
        };
        let place = self.geodetic(pose)?;
        let here = LocalFrame::new(place);
        let rotation = match (&self.places, &pose.attitude) {
            // A quaternion is relative to the axes of the projection: grid north is not north.
            (Places::Projected(projection), RawAttitude::Rotation(rotation)) => {
                here_from_grid(projection, &here, pose.place)? * rotation
            }
            _ => self.rotation(&pose.attitude),
        };
        let position = local.world_from_geodetic(&place);
        Ok(Isometry3::from_parts(Translation3::from(position.coords), local.rotation_from(&here) * rotation))
    }

    /// Rotation from forward, left, up to east, north, up.
    fn rotation(&self, attitude: &RawAttitude) -> UnitQuaternion<f64> {
        let [roll, pitch, heading] = match attitude {
            RawAttitude::Rotation(rotation) => return *rotation,
            RawAttitude::Angles(angles) => *angles,
        };
        let yaw = match self.heading {
            HeadingSense::ClockwiseFromNorth => FRAC_PI_2 - heading,
            HeadingSense::CounterclockwiseFromEast => heading,
            HeadingSense::CounterclockwiseFromNorth => FRAC_PI_2 + heading,
        };
        // Pitch is nose up: about the axis to the right.
        UnitQuaternion::from_euler_angles(roll, -pitch, yaw)
    }
}

fn places(kind: PlaceKind, entry: &TrajectoryEntry) -> Result<Places, String> {
    let frame = entry.frame.as_deref();
    let epsg = frame.and_then(|frame| frame.strip_prefix("EPSG:"));
    match (kind, frame, epsg) {
        (PlaceKind::Geodetic, None | Some("geodetic"), _) => Ok(Places::Geodetic),
        (PlaceKind::Local, None | Some("local"), _) | (PlaceKind::Projected, Some("local"), _) => Ok(Places::Local),
        (PlaceKind::Local | PlaceKind::Projected, _, Some(epsg)) => projection(epsg),
        (PlaceKind::Projected, None, _) => {
            Err("places are eastings and northings; set trajectory.frame to their UTM zone, such as \"EPSG:32632\", \
                 or to \"local\" with trajectory.origin"
                .into())
        }
        (_, Some(frame), _) => Err(format!(
            "trajectory.frame {frame:?} does not fit the columns of the file; it must be \"geodetic\" for latitudes and longitudes, \
             \"local\" or \"EPSG:\" and a UTM zone for metres"
        )),
    }
}

/// The UTM zone of an EPSG code: WGS 84 (326nn, 327nn), ETRS89 (258nn), NAD83 (269nn).
fn projection(epsg: &str) -> Result<Places, String> {
    let other = || {
        format!(
            "trajectory.frame EPSG:{epsg} is not a UTM zone (326nn, 327nn, 258nn, 269nn); export latitude and longitude"
        )
    };
    let code: u32 = epsg.parse().map_err(|_| other())?;
    let zone = code % 100;
    let south = match code / 100 {
        326 | 258 | 269 => "",
        327 => " +south",
        _ => return Err(other()),
    };
    if !(1..=60).contains(&zone) {
        return Err(other());
    }
    let found = Projection::new(&format!("+proj=utm +zone={zone}{south}"), "+datum=WGS84");
    found.map(|found| Places::Projected(Box::new(found))).map_err(|error| error.to_string())
}

/// Rotation from the axes of a projection to east, north and up at a place.
fn here_from_grid(
    projection: &Projection,
    here: &LocalFrame,
    [e, n, h]: [f64; 3],
) -> Result<UnitQuaternion<f64>, String> {
    let north = projection.unproject([e, n + STEP_M, h]).map_err(|error| error.to_string())?;
    let north: Point3<f64> = here.world_from_geodetic(&north);
    Ok(UnitQuaternion::from_axis_angle(&Vector3::z_axis(), north.y.atan2(north.x) - FRAC_PI_2))
}
