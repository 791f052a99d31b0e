//! Environment variables that ROS 2 gives a node: the domain, the range of discovery, and the mapping of services.

use miette::miette;
use ros2_client::ServiceMapping;
use ros2_client::distributions::{COMPILED_ROS_DISTRO, RosDistro};

/// Maximum domain ID; higher ones have no UDP ports.
const DOMAIN_MAX: u16 = 232;

/// Environment of a node in the ROS network.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Environment {
    /// `ROS_DOMAIN_ID`.
    pub domain: u16,
    /// True if discovery is limited to this computer: by `ROS_AUTOMATIC_DISCOVERY_RANGE`, or by `ROS_LOCALHOST_ONLY` before
    /// Iron.
    pub loopback: bool,
    /// Mapping of services to DDS, by `RMW_IMPLEMENTATION`. DDS implementations put the request number into different fields.
    pub mapping: ServiceMapping,
}

impl Environment {
    /// Reads the variables of this process.
    ///
    /// # Errors
    /// Returns an error if a variable has a value that this node does not support.
    pub fn read() -> miette::Result<Self> {
        Self::of(|name| std::env::var(name).ok().filter(|value| !value.is_empty()))
    }

    fn of(value: impl Fn(&str) -> Option<String>) -> miette::Result<Self> {
        let domain = match value("ROS_DOMAIN_ID") {
            None => 0,
            Some(text) => {
                text.parse().ok().filter(|domain| *domain <= DOMAIN_MAX).ok_or_else(|| {
                    miette!("ROS_DOMAIN_ID is `{text}`; expected a number from 0 to {DOMAIN_MAX}")
                })?
            }
        };
        let only = match value("ROS_LOCALHOST_ONLY").as_deref() {
            None | Some("0") => false,
            Some("1") => true,
            Some(other) => return Err(miette!("ROS_LOCALHOST_ONLY is `{other}`; expected 0 or 1")),
        };
        let near = match value("ROS_AUTOMATIC_DISCOVERY_RANGE").as_deref() {
            None | Some("SUBNET" | "SYSTEM_DEFAULT") => false,
            Some("LOCALHOST") => true,
            Some(other) => {
                return Err(miette!(
                    "ROS_AUTOMATIC_DISCOVERY_RANGE is `{other}`; expected SUBNET or LOCALHOST"
                ));
            }
        };
        let mapping = match value("RMW_IMPLEMENTATION").as_deref() {
            None | Some("rmw_fastrtps_cpp" | "rmw_fastrtps_dynamic_cpp") => {
                ServiceMapping::Enhanced
            }
            Some("rmw_cyclonedds_cpp") => ServiceMapping::Cyclone,
            Some(other) => {
                return Err(miette!(
                    help = "set RMW_IMPLEMENTATION to one of these, for the other nodes as well",
                    "RMW_IMPLEMENTATION is `{other}`; expected rmw_fastrtps_cpp or \
                     rmw_cyclonedds_cpp"
                ));
            }
        };
        Ok(Self { domain, loopback: only || near, mapping })
    }
}

/// Warning if `ROS_DISTRO` is a distribution whose node graph has another wire format than this build.
pub fn other_distribution() -> Option<String> {
    let distribution = std::env::var("ROS_DISTRO").ok()?;
    let (old, is_old) = (distribution == "humble", COMPILED_ROS_DISTRO < RosDistro::Iron);
    (old != is_old).then(|| {
        let features = if old { " with --no-default-features" } else { "" };
        format!(
            "ROS_DISTRO is {distribution}, but this build is for {}, so `ros2 node list` does not \
             show the node (topics and services work): build the node{features} for {distribution}",
            if is_old { "humble" } else { "iron and later" }
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(variables: &[(&str, &str)]) -> miette::Result<Environment> {
        let find = |name: &str| variables.iter().find(|(known, _)| *known == name);
        Environment::of(|name| find(name).map(|(_, value)| (*value).to_owned()))
    }

    #[test]
    fn without_variables_a_node_is_as_those_of_ros_are() {
        let expected =
            Environment { domain: 0, loopback: false, mapping: ServiceMapping::Enhanced };
        assert_eq!(of(&[]).unwrap(), expected);
    }

    #[test]
    fn variables_of_both_generations_are_followed() {
        let expected = Environment { domain: 42, loopback: true, mapping: ServiceMapping::Cyclone };
        let cyclone = [("RMW_IMPLEMENTATION", "rmw_cyclonedds_cpp"), ("ROS_DOMAIN_ID", "42")];
        for near in [("ROS_LOCALHOST_ONLY", "1"), ("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")] {
            assert_eq!(of(&[cyclone[0], cyclone[1], near]).unwrap(), expected);
        }
    }

    #[test]
    fn what_cannot_be_followed_is_refused_by_name_and_value() {
        for (name, value) in [
            ("ROS_DOMAIN_ID", "233"),
            ("ROS_DOMAIN_ID", "-1"),
            ("ROS_LOCALHOST_ONLY", "yes"),
            ("ROS_AUTOMATIC_DISCOVERY_RANGE", "OFF"),
            ("RMW_IMPLEMENTATION", "rmw_zenoh_cpp"),
        ] {
            let error = of(&[(name, value)]).unwrap_err().to_string();
            assert!(error.starts_with(&format!("{name} is `{value}`")), "{error}");
        }
    }
}
