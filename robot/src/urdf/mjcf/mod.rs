//! MJCF, the models of MuJoCo, as the links and joints of a URDF: <https://mujoco.readthedocs.io/en/stable/XMLreference.html>.
//!
//! `model` has the settings and classes of defaults. `numbers` reads attributes and poses, `geoms` solids and their masses,
//! `bodies` the tree, `home` the standing pose. `dropped` names elements that robot files lack. As in URDF, the frame of a
//! link is that of its joint: the reader moves a body to the anchor of its joint. It reads neither meshes nor included files.

mod bodies;
mod dropped;
mod geoms;
mod home;
mod model;
mod numbers;

use super::model::Urdf;
use super::notes::Notes;
use crate::document::DocumentError;
use model::Model;
use numbers::Reader;
use roxmltree::Node;

/// Maximum number of classes of defaults. Models have a few dozen.
const CLASSES_MAX: usize = 1000;
/// Lists that the reader uses.
const READ: [&str; 4] = ["worldbody", "actuator", "equality", "tendon"];
/// Maximum number of elements of a list: ten for each body.
const ELEMENTS_MAX: usize = 20_000;
/// Elements that MuJoCo replaces by others.
const MACROS: [&str; 5] = ["include", "attach", "replicate", "composite", "flexcomp"];
const SAVE: &str = "have MuJoCo write the whole model: \
                    `mujoco.mj_saveLastXML(\"whole.xml\", mujoco.MjModel.from_xml_path(\"robot.xml\"))`";

/// Reads the elements of a model whose root is `<mujoco>`.
pub(super) fn read(root: Node<'_, '_>, notes: &mut Notes<'_>) -> Result<Urdf, DocumentError> {
    let model = Model::new(root);
    let mut reader = Reader { notes, model: &model };
    for node in root.descendants().filter(|node| MACROS.contains(&node.tag_name().name())) {
        reader.fault(node, format!("<{}> stands for other elements", node.tag_name().name()), SAVE);
    }
    if let Some(compiler) = model.global {
        let help =
            "MuJoCo 2.3.3 and later read local coordinates only: convert it with an older one";
        reader.fault(compiler, "the model has global coordinates", help);
    }
    if let Some(compiler) = model.scaled {
        reader.fault(compiler, "`settotalmass` scales all masses, and is not read", SAVE);
    }
    let classes = model.classes().len();
    if classes > CLASSES_MAX {
        let message = format!("the model has {classes} classes of defaults");
        let help = format!("at most {CLASSES_MAX} are read: is this the right file?");
        reader.fault(root, message, &help);
    }
    for list in root.children().filter(|node| READ.contains(&node.tag_name().name())) {
        let count = list.descendants().filter(Node::is_element).count();
        if count > ELEMENTS_MAX {
            let message = format!("<{}> has {count} elements", list.tag_name().name());
            let help = format!("at most {ELEMENTS_MAX} are read: is this the right file?");
            reader.fault(list, message, &help);
        }
    }
    reader.notes.check()?;
    let urdf = bodies::read(root, &mut reader);
    dropped::warn(root, &mut reader);
    reader.notes.check()?;
    if urdf.links.is_empty() {
        reader.fault(root, "the model has no <body>", "a robot is a <body> of <worldbody>");
    }
    reader.notes.check()?;
    Ok(urdf)
}
