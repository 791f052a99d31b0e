//! Names of the node, its topics and its services, with their remapping by `--ros-args`; also the parameters of `--ros-args`.

use crate::parameters::Parameters;
use miette::{IntoDiagnostic, WrapErr, miette};
use ros2_client::{Name, NodeName};
use std::ffi::OsString;

/// Parsed arguments after `--ros-args`.
#[derive(Clone, Debug, PartialEq)]
pub struct Names {
    pub node: NodeName,
    /// Fully qualified names, each with its replacement.
    replaced: Vec<(String, String)>,
    pub parameters: Parameters,
}

impl Names {
    /// Separates the arguments for ROS, as `ros2 run` and `ros2 launch` add them, from the rest of a command line.
    ///
    /// # Errors
    /// Returns an error if this node does not support an argument, or if ROS does not allow a name.
    pub fn split(
        arguments: impl IntoIterator<Item = OsString>,
    ) -> miette::Result<(Self, Vec<OsString>)> {
        let mut own = Vec::new();
        let mut rules = Vec::new();
        let mut parameters = Parameters::default();
        let mut arguments = arguments.into_iter();
        let mut for_ros = false;
        while let Some(argument) = arguments.next() {
            // File names need not be valid UTF-8; names of ROS are.
            match (argument.to_str(), for_ros) {
                (Some("--ros-args"), _) => for_ros = true,
                (_, false) => own.push(argument),
                (Some("--"), true) => for_ros = false,
                (Some("-r" | "--remap"), true) => rules.push(rule(arguments.next())?),
                (Some("-p" | "--param"), true) => {
                    parameters.set(&arguments.next().unwrap_or_default().to_string_lossy())?;
                }
                (_, true) => {
                    return Err(miette!(
                        help = "after --ros-args, give `-r __node:=NAME`, `-r __ns:=/NAMESPACE`, \
                            `-r TOPIC:=OTHER` or `-p PARAMETER:=VALUE`",
                        "the node does not support the ROS argument `{}`",
                        argument.display()
                    ));
                }
            }
        }
        Ok((Self::new(&rules, parameters)?, own))
    }

    fn new(rules: &[(String, String)], parameters: Parameters) -> miette::Result<Self> {
        let of = |keys: &[&str]| rules.iter().rev().find(|(from, _)| keys.contains(&from.as_str()));
        let name = of(&["__node", "__name"]).map_or("rollwalk", |(_, to)| to);
        let namespace = of(&["__ns"]).map_or("/", |(_, to)| to);
        let node = NodeName::new(namespace, name).into_diagnostic().wrap_err_with(|| {
            format!("`{namespace}` and `{name}` are not a valid namespace and name of a node")
        })?;
        let mut names = Self { node, replaced: Vec::new(), parameters };
        let topics = rules.iter().filter(|(from, _)| !from.starts_with("__"));
        names.replaced = topics.map(|(from, to)| (names.expand(from), names.expand(to))).collect();
        Ok(names)
    }

    /// Resolves a name by the rules of ROS, such as `~/play`, `joint_states` or `/diagnostics`.
    ///
    /// # Errors
    /// Returns an error if `--ros-args` replaces the name by one that ROS does not allow.
    pub fn resolve(&self, name: &str) -> miette::Result<Name> {
        let full = self.expand(name);
        let replaced = self.replaced.iter().find(|(from, _)| *from == full);
        let full = replaced.map_or(full, |(_, to)| to.clone());
        let parsed = Name::parse(&full).into_diagnostic();
        parsed.wrap_err_with(|| format!("`{full}` is not a valid name of a topic or service"))
    }

    fn expand(&self, name: &str) -> String {
        let namespace = self.node.namespace().trim_end_matches('/');
        match (name.strip_prefix("~/"), name.starts_with('/')) {
            (Some(own), _) => format!("{}/{own}", self.node.fully_qualified_name()),
            (None, true) => name.to_owned(),
            (None, false) => format!("{namespace}/{name}"),
        }
    }
}

/// Parses a rule `FROM:=TO`.
fn rule(text: Option<OsString>) -> miette::Result<(String, String)> {
    let text = text.unwrap_or_default();
    let text = text.to_string_lossy();
    let halves = text.split_once(":=").filter(|(from, to)| !from.is_empty() && !to.is_empty());
    let (from, to) = halves.ok_or_else(|| miette!("`-r {text}`: give a rule as FROM:=TO"))?;
    Ok((from.to_owned(), to.to_owned()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn split(line: &str) -> miette::Result<(Names, Vec<OsString>)> {
        Names::split(line.split(' ').map(OsString::from))
    }

    #[test]
    fn names_are_those_of_ros_by_default() {
        let (names, own) = split("rollwalk-ros2 --bus sim").unwrap();
        assert_eq!(own, ["rollwalk-ros2", "--bus", "sim"]);
        for (name, full) in [
            ("~/play", "/rollwalk/play"),
            ("joint_states", "/joint_states"),
            ("/diagnostics", "/diagnostics"),
        ] {
            assert_eq!(names.resolve(name).unwrap().to_string(), full);
        }
    }

    #[test]
    fn a_launch_file_names_the_node_and_its_topics() {
        let line = "node --ros-args -r __node:=pup -r __ns:=/lab -r joint_states:=/js --remap ~/play:=go -- --bus sim";
        let (names, own) = split(line).unwrap();
        assert_eq!(own, ["node", "--bus", "sim"]);
        for (name, full) in [
            ("~/arm", "/lab/pup/arm"),
            ("~/play", "/lab/go"),
            ("joint_states", "/js"),
            ("robot_description", "/lab/robot_description"),
        ] {
            assert_eq!(names.resolve(name).unwrap().to_string(), full);
        }
    }

    #[cfg(unix)]
    #[test]
    fn what_is_no_text_is_left_to_the_command_line_or_refused() {
        use std::os::unix::ffi::OsStringExt;
        let file = || OsString::from_vec(b"caf\xe9.toml".to_vec());
        let (_, own) = Names::split(["node".into(), "--robot".into(), file()]).unwrap();
        assert_eq!(own, ["node".into(), "--robot".into(), file()]);
        for before in ["--ros-args", "--ros-args -r"] {
            let all = before.split(' ').map(OsString::from).chain([file()]);
            let error = Names::split(all).unwrap_err().to_string();
            assert!(error.contains("caf\u{fffd}.toml"), "{error}");
        }
    }

    #[test]
    fn what_ros_would_refuse_is_refused_with_its_words() {
        for (line, words) in [
            (
                "node --ros-args --params-file x",
                "does not support the ROS argument `--params-file`",
            ),
            ("node --ros-args -p rate:=3", "no parameter `rate`"),
            ("node --ros-args -p", "give a parameter as NAME:=VALUE"),
            ("node --ros-args -r a", "`-r a`: give a rule as FROM:=TO"),
            ("node --ros-args -r", "give a rule as FROM:=TO"),
            (
                "node --ros-args -r __node:=a-b",
                "`/` and `a-b` are not a valid namespace and name of a node",
            ),
        ] {
            let error = split(line).unwrap_err().to_string();
            assert!(error.contains(words), "{line}: {error}");
        }
        let (names, _) = split("node --ros-args -r joint_states:=/1st").unwrap();
        let error = names.resolve("joint_states").unwrap_err().to_string();
        assert!(error.contains("`/1st` is not a valid name"), "{error}");
    }
}
