//! The fields of a `PointCloud2`.

use super::RawPoint;
use crate::ros::cursor::{Cursor, MessageFault};
use crate::ros::messages::Header;
use formats::cloud_fields::{Field, ValueType};

/// Maximum number of fields of a cloud; real ones have a dozen.
const MAX_FIELDS: usize = 256;

/// Type and position of a value in a row.
#[derive(Clone, Copy, Debug)]
struct Value {
    offset: usize,
    /// Number of the type in `sensor_msgs/PointField`.
    datatype: u8,
}

/// A cloud and the positions of its values.
#[derive(Debug)]
pub(crate) struct Fields<'a> {
    pub header: Header,
    /// Rows; sensors with fixed beams often have one per beam.
    pub height: u32,
    /// Name of the field of the times.
    pub time_name: Option<String>,
    /// Name of the field of the rings.
    pub ring_name: Option<String>,
    position: [Value; 3],
    intensity: Option<Value>,
    ring: Option<Value>,
    time: Option<Value>,
    is_big: bool,
    point_step: usize,
    row_step: usize,
    width: usize,
    data: &'a [u8],
}

/// The type of this number in `sensor_msgs/PointField`.
fn value_type(datatype: u8) -> Option<ValueType> {
    Some(match datatype {
        1 => ValueType::I8,
        2 => ValueType::U8,
        3 => ValueType::I16,
        4 => ValueType::U16,
        5 => ValueType::I32,
        6 => ValueType::U32,
        7 => ValueType::F32,
        8 => ValueType::F64,
        _ => return None,
    })
}

impl Value {
    fn decode(self, row: &[u8], is_big: bool) -> f64 {
        let bytes = row.get(self.offset..).unwrap_or_default();
        value_type(self.datatype).map_or(f64::NAN, |value_type| value_type.decode(bytes, is_big))
    }
}

impl<'a> Fields<'a> {
    pub fn read(c: &mut Cursor<'a>) -> Result<Self, MessageFault> {
        let header = Header::read(c)?;
        let height = c.u32("height")?;
        let width = c.u32("width")?;
        // A name, two numbers and a byte.
        let n_fields = c.length("fields", 13)?;
        if n_fields > MAX_FIELDS {
            return Err(MessageFault::Rule(format!("{n_fields} fields; at most {MAX_FIELDS} are read")));
        }
        let mut fields = Vec::new();
        for _ in 0..n_fields {
            let name = c.text("fields.name")?;
            let offset = c.u32("fields.offset")?;
            let datatype = c.u8("fields.datatype")?;
            let count = c.u32("fields.count")?;
            fields.push((name, Value { offset: offset as usize, datatype }, count));
        }
        let is_big = c.u8("is_bigendian")? != 0;
        let point_step = c.u32("point_step")? as usize;
        let row_step = c.u32("row_step")? as usize;
        let data = c.blob("data")?;
        let find = |field: Field| {
            // Some drivers state a count of 0 for one value; a field of several values is another one.
            let names = fields.iter().map(|(name, _, count)| if *count <= 1 { name.as_str() } else { "" });
            field.find(&names).map(|index| (fields[index].0.clone(), fields[index].1))
        };
        let mut position = [Value { offset: 0, datatype: 7 }; 3];
        for (value, field) in position.iter_mut().zip([Field::X, Field::Y, Field::Z]) {
            let names: Vec<&str> = fields.iter().map(|(name, ..)| name.as_str()).collect();
            let missing =
                || MessageFault::Rule(format!("no field {}; the fields are {}", field.names()[0], names.join(", ")));
            *value = find(field).ok_or_else(missing)?.1;
        }
        let intensity = find(Field::Intensity).map(|(_, value)| value);
        let (ring_name, ring) = find(Field::Ring).unzip();
        let (time_name, time) = find(Field::Time).unzip();
        let cloud = Self {
            header,
            height,
            time_name,
            ring_name,
            position,
            intensity,
            ring,
            time,
            is_big,
            point_step,
            row_step,
            width: width as usize,
            data,
        };
        cloud.check()?;
        Ok(cloud)
    }

    /// Checks that every value lies in its point, every point in its row, every row in the data.
    fn check(&self) -> Result<(), MessageFault> {
        let rule = |text: String| Err(MessageFault::Rule(text));
        for value in self.position.iter().chain(&self.intensity).chain(&self.ring).chain(&self.time) {
            let Some(n) = value_type(value.datatype).map(ValueType::size) else {
                return rule(format!("a field has datatype {}; must be 1 to 8", value.datatype));
            };
            if value.offset.saturating_add(n) > self.point_step {
                return rule(format!("a field ends at byte {}; point_step is {}", value.offset + n, self.point_step));
            }
        }
        let height = self.height as usize;
        let step = self.row_step;
        let row_bytes = self.width.saturating_mul(self.point_step);
        if height > 1 && row_bytes > step {
            return rule(format!("row_step {step} must be at least width x point_step, {row_bytes}"));
        }
        let n_bytes = if height == 0 { 0 } else { step.saturating_mul(height - 1).saturating_add(row_bytes) };
        let found = self.data.len();
        if n_bytes > found {
            return rule(format!("{height} x {} points need {n_bytes} bytes of data; {found} are there", self.width));
        }
        Ok(())
    }

    /// Least precise type of a coordinate.
    pub fn position_type(&self) -> ValueType {
        let types = self.position.iter().filter_map(|value| value_type(value.datatype));
        types.reduce(|a, b| if b == ValueType::F32 { b } else { a }).unwrap_or(ValueType::F32)
    }

    /// The points with coordinates that are numbers.
    pub fn points(&self) -> impl Iterator<Item = RawPoint> {
        let n_rows = if self.width == 0 { 0 } else { self.height as usize };
        let rows = (0..n_rows).map(|row| &self.data[row * self.row_step..]);
        let points = rows.flat_map(|row| row[..self.width * self.point_step].chunks_exact(self.point_step.max(1)));
        points.map(|row| self.point(row)).filter(|point| point.position.iter().all(|value| value.is_finite()))
    }

    fn point(&self, row: &[u8]) -> RawPoint {
        let decode = |value: Value| value.decode(row, self.is_big);
        RawPoint {
            position: self.position.map(decode),
            intensity: self.intensity.map_or(0.0, decode) as f32,
            ring: self.ring.map(|value| decode(value) as u16),
            time: self.time.map(decode),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ros::bag::Encoding;

    /// A cloud of ROS 1 with fields `(name, offset, datatype)`.
    fn message(size: [u32; 2], fields: &[(&str, u32, u8)], is_big: bool, steps: [u32; 2], data: &[u8]) -> Vec<u8> {
        let mut bytes = vec![0; 16];
        bytes.extend(size.map(u32::to_le_bytes).concat());
        bytes.extend((fields.len() as u32).to_le_bytes());
        for (name, offset, datatype) in fields {
            bytes.extend((name.len() as u32).to_le_bytes());
            bytes.extend(name.as_bytes());
            bytes.extend(offset.to_le_bytes());
            bytes.push(*datatype);
            bytes.extend(1_u32.to_le_bytes());
        }
        bytes.push(u8::from(is_big));
        bytes.extend(steps.map(u32::to_le_bytes).concat());
        bytes.extend((data.len() as u32).to_le_bytes());
        bytes.extend(data);
        bytes.push(1);
        bytes
    }

    fn read(message: &[u8]) -> Result<Vec<RawPoint>, MessageFault> {
        let mut cursor = Cursor::new(Encoding::Ros1, message)?;
        Fields::read(&mut cursor).map(|fields| fields.points().collect())
    }

    #[test]
    fn big_endian_rows_with_gaps_are_read() {
        let fields = [("z", 0, 7), ("x", 4, 3), ("y", 6, 8), ("ring", 14, 2)];
        let mut data = Vec::new();
        for (z, ring) in [(1.5_f32, 200_u8), (f32::NAN, 1)] {
            data.extend(z.to_be_bytes());
            data.extend((-2_i16).to_be_bytes());
            data.extend(0.25_f64.to_be_bytes());
            data.push(ring);
            // 2 bytes between points, 3 between rows.
            data.extend([9; 5]);
        }
        data.truncate(2 * 17 + 3);
        let points = read(&message([2, 1], &fields, true, [17, 20], &data)).expect("reads");
        assert_eq!(
            points,
            [RawPoint { position: [-2.0, 0.25, 1.5], intensity: 0.0, ring: Some(200), time: None }],
            "the point without z is left out"
        );
    }

    #[test]
    fn layouts_that_leave_their_data_are_refused() {
        let xyz = [("x", 0, 7), ("y", 4, 7), ("z", 8, 7)];
        for (size, fields, steps, rule) in [
            ([1, 2], &xyz[..2], [12, 24], "no field z; the fields are x, y"),
            ([1, 2], &xyz[..], [11, 22], "a field ends at byte 12; point_step is 11"),
            ([1, 3], &xyz[..], [12, 36], "1 x 3 points need 36 bytes of data; 24 are there"),
            ([u32::MAX, u32::MAX], &xyz[..], [12, 0], "row_step 0 must be at least"),
            ([1, u32::MAX], &xyz[..], [u32::MAX, 0], "need"),
            ([1, 2], &[("x", 0, 7), ("y", 4, 9), ("z", 8, 7)][..], [12, 24], "datatype 9"),
            ([1, 2], &[("x", u32::MAX, 7), ("y", 4, 7), ("z", 8, 7)][..], [12, 24], "point_step is 12"),
        ] {
            let error = read(&message(size, fields, false, steps, &[0; 24])).expect_err(rule).to_string();
            assert!(error.contains(rule), "{error}");
        }
        assert_eq!(read(&message([0, 7], &xyz, false, [12, 0], &[])), Ok(Vec::new()));
    }
}
