# The spine leans forward by 20 degrees: awk -f lean.awk content.bvh > answer.bvh
$1 == "ROOT" || $1 == "JOINT" { joint = $2 }
$1 == "CHANNELS" {
  for (i = 3; i <= NF; i++) {
    column++
    if (joint == "Spine" && $i == "Xrotation") spine = column
  }
}
in_motion { $spine = $spine + 20 }
/^Frame Time/ { in_motion = 1 }
{ print }
