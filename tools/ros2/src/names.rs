//! Names of ROS 2 in DDS.
//!
//! | | ROS 2 | DDS |
//! |---|---|---|
//! | topic | `/front/image_raw` | `rt/front/image_raw` |
//! | type | `sensor_msgs/Image` | `sensor_msgs::msg::dds_::Image_` |

/// The name of a topic; `None` for services, actions and topics of other programs.
pub fn topic_from_dds(name: &str) -> Option<String> {
    let rest = name.strip_prefix("rt/")?;
    (!rest.is_empty()).then(|| format!("/{rest}"))
}

/// The name of a message type without `/msg`, as in the import of bags; `None` for other types.
pub fn type_from_dds(name: &str) -> Option<String> {
    let (package, name) = name.split_once("::msg::dds_::")?;
    let name = name.strip_suffix('_')?;
    let is_word = |word: &str| !word.is_empty() && word.chars().all(|c| c.is_ascii_alphanumeric() || c == '_');
    (is_word(package) && is_word(name)).then(|| format!("{package}/{name}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_those_of_ros() {
        assert_eq!(topic_from_dds("rt/front/image_raw").as_deref(), Some("/front/image_raw"));
        assert_eq!(type_from_dds("sensor_msgs::msg::dds_::Image_").as_deref(), Some("sensor_msgs/Image"));
        for other in ["rq/add_two_intsRequest", "rt/", "ros_discovery_info", ""] {
            assert_eq!(topic_from_dds(other), None, "{other}");
        }
        for other in [
            "ShapeType",
            "a::srv::dds_::B_Request_",
            "::msg::dds_::Image_",
            "a::msg::dds_::Image",
            "a::msg::dds_::_",
            "é::msg::dds_::A_",
        ] {
            assert_eq!(type_from_dds(other), None, "{other}");
        }
    }
}
