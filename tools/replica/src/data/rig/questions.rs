//! Questions on a terminal for values that the arguments of `replica rig new` lack.

use geometry::{Pose, Translation3, UnitQuaternion};
use lidar::Model;
use rig::rotation;
use std::io::{self, BufRead, Write};

/// The known values.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Answers {
    /// Name of the drive.
    pub name: Option<String>,
    /// Model of the LiDAR.
    pub model: Option<Model>,
    /// Mounting of the LiDAR.
    pub body_from_lidar: Option<Pose>,
    /// Mounting of the IMU; `None`: no IMU.
    pub body_from_imu: Option<Pose>,
    /// Position of the antenna, m; `None`: no receiver.
    pub antenna_in_body: Option<[f64; 3]>,
    /// Origin of the world frame.
    pub origin: Option<[f64; 3]>,
}

/// Asks for unknown values. An empty line selects the value in brackets. After the end of the input the rest stays unknown.
pub fn ask(mut known: Answers, input: &mut impl BufRead, output: &mut impl Write) -> io::Result<Answers> {
    let mut terminal = Terminal { input, output };
    if known.name.is_none() {
        known.name = terminal.question("Name of the drive [the folder's]", |text| Ok(text.to_owned()))?;
    }
    if known.model.is_none() {
        let model = |text: &str| Model::from_name(text).ok_or_else(|| format!("must be one of {}", Model::names()));
        known.model = terminal.question(&format!("Model of the LiDAR ({})", Model::names()), model)?;
    }
    if known.body_from_lidar.is_none() {
        known.body_from_lidar = terminal.mounting("the LiDAR")?;
    }
    if known.body_from_imu.is_none() && terminal.is_there("an IMU (imu.csv)")? {
        known.body_from_imu = terminal.mounting("the IMU")?;
    }
    if known.antenna_in_body.is_none() && terminal.is_there("a GNSS receiver (gnss.nmea)")? {
        let place = "Position of the antenna in the body, m: forward,left,up [0,0,0]";
        known.antenna_in_body = Some(terminal.question(place, position)?.unwrap_or_default());
    }
    if known.antenna_in_body.is_some() && known.origin.is_none() {
        let origin = "Origin of the world frame near the drive: latitude,longitude,height (degrees, m)";
        known.origin = terminal.question(origin, position)?;
    }
    Ok(known)
}

struct Terminal<'a, I, O> {
    input: &'a mut I,
    output: &'a mut O,
}

impl<I: BufRead, O: Write> Terminal<'_, I, O> {
    /// Repeats a question until the answer is valid; `None` for an empty line and at the end of the input.
    fn question<T>(&mut self, text: &str, read: impl Fn(&str) -> Result<T, String>) -> io::Result<Option<T>> {
        loop {
            write!(self.output, "{text}: ")?;
            self.output.flush()?;
            let mut line = String::new();
            if self.input.read_line(&mut line)? == 0 || line.trim().is_empty() {
                return Ok(None);
            }
            match read(line.trim()) {
                Ok(value) => return Ok(Some(value)),
                Err(rule) => writeln!(self.output, "{:?} {rule}", line.trim())?,
            }
        }
    }

    fn is_there(&mut self, what: &str) -> io::Result<bool> {
        let answer = |text: &str| match text {
            "y" | "yes" => Ok(true),
            "n" | "no" => Ok(false),
            _ => Err("must be y or n".to_owned()),
        };
        Ok(self.question(&format!("Is there {what}? y or [n]"), answer)?.unwrap_or(false))
    }

    fn mounting(&mut self, what: &str) -> io::Result<Option<Pose>> {
        let text = format!("Position of {what} in the body, m: forward,left,up [0,0,0]");
        let place = self.question(&text, position)?.unwrap_or_default();
        let rotation = |text: &str| rotation::parse(text).map_err(|error| error.to_string());
        let text = format!("Rotation of {what}, for example {} [none]", rotation::FORMS);
        let rotation = self.question(&text, rotation)?.unwrap_or_else(UnitQuaternion::identity);
        Ok(Some(Pose::from_parts(Translation3::from(place), rotation)))
    }
}

/// A position from the command line or an answer.
pub(super) fn position(text: &str) -> Result<[f64; 3], String> {
    let numbers: Option<Vec<f64>> =
        text.split(',').map(|number| number.trim().parse().ok().filter(|v: &f64| v.is_finite())).collect();
    numbers.and_then(|numbers| numbers.try_into().ok()).ok_or_else(|| "must be three numbers X,Y,Z".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wrong_answers_are_asked_again_and_empty_ones_are_the_defaults() {
        let lines = "\nhdl33\nhdl32e\n0,0,1.9\neuler zyx 1,2,3\nrpy deg 0,0,90\nn\nyes\n1,0,2\n48,2,100\n";
        let mut output = Vec::new();
        let found = ask(Answers::default(), &mut lines.as_bytes(), &mut output).expect("answers");
        let printed = String::from_utf8(output).expect("text");
        assert!(printed.contains("\"hdl33\" must be one of hdl32e"), "{printed}");
        assert!(printed.contains("need intrinsic or extrinsic"), "{printed}");
        assert_eq!((found.name, found.model), (None, Model::from_name("hdl32e")));
        let lidar = found.body_from_lidar.expect("a mounting");
        assert!((lidar.translation.z - 1.9).abs() < 1e-12 && (lidar.rotation.angle().to_degrees() - 90.0).abs() < 1e-9);
        assert_eq!(found.body_from_imu, None);
        assert_eq!((found.antenna_in_body, found.origin), (Some([1.0, 0.0, 2.0]), Some([48.0, 2.0, 100.0])));
    }

    #[test]
    fn known_values_are_not_asked() {
        let known = Answers {
            name: Some("a".into()),
            model: Model::from_name("vlp16"),
            body_from_lidar: Some(Pose::identity()),
            body_from_imu: Some(Pose::identity()),
            antenna_in_body: Some([0.0; 3]),
            origin: Some([0.0; 3]),
        };
        let mut output = Vec::new();
        assert_eq!(ask(known.clone(), &mut "".as_bytes(), &mut output).expect("answers"), known);
        assert!(output.is_empty());
    }
}
