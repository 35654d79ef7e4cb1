//! What this reader needs of an XML element. Names are compared without their namespace, and what is not asked for
//! is not looked at: a file may carry anything beside the roads.
//!
//! The crate `opendrive` (0.1.0) takes files of version 1.7 alone: it knows no crossfall, which those of 1.4 and 1.5 have, and
//! refuses a file for an attribute that is missing where nobody reads it. It brings uom, chrono and backtrace.

use roxmltree::Node;

use super::error::{RoadError, refuse};

/// The children of an element that bear a name.
pub(super) fn children<'a>(node: Node<'a, 'a>, name: &'static str) -> impl Iterator<Item = Node<'a, 'a>> {
    node.children()
        .filter(move |child| child.is_element() && child.tag_name().name() == name)
}

/// The first of them.
pub(super) fn child<'a>(node: Node<'a, 'a>, name: &'static str) -> Option<Node<'a, 'a>> {
    children(node, name).next()
}

/// An attribute without its namespace and without spaces around it.
pub(super) fn text<'a>(node: Node<'a, 'a>, name: &str) -> Option<&'a str> {
    let found = node.attributes().find(|attribute| attribute.name() == name);
    found.map(|attribute| attribute.value().trim())
}

/// A number that has to be there. `place` says where in the file, for people.
pub(super) fn number(node: Node, name: &str, place: &str) -> Result<f64, RoadError> {
    let element = node.tag_name().name();
    let Some(text) = text(node, name) else {
        return refuse(format!("{place}: <{element}> has no `{name}`"));
    };
    let value = text.parse().ok().filter(|value: &f64| value.is_finite());
    value.ok_or_else(|| format!("{place}: {name}=\"{text}\" of <{element}> is not a number").into())
}

/// The coefficients `a` to `d` of a cubic polynomial, the names ending with `suffix`.
pub(super) fn cubic(node: Node, suffix: &str, place: &str) -> Result<[f64; 4], RoadError> {
    let mut cubic = [0.0; 4];
    for (slot, letter) in cubic.iter_mut().zip(["a", "b", "c", "d"]) {
        *slot = number(node, &format!("{letter}{suffix}"), place)?;
    }
    Ok(cubic)
}
