"""The commands that same_results.py runs with two versions of usdhand.

A line is `NAME  COMMAND`, in an order in which they can run. In a command, `{s}` is the samples,
`{r}` the real takes, `{m}` what same_inputs.py makes, `{o}` the step's own folder, and `{NAME}`
that of another step, which is then run before. `!FUNCTION` calls one of same_inputs.py instead of
a verb. A star before the name: part of `--quick`.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass

OK, TALK = "{s}/gestures/ok_01.usdc", "{s}/conversations/talk_01"
PINS = "--pin 1:1 --pin 181:403"
FULL, MINI, FBX = "{r}/studiogalt/full/SG_ASL_", "{r}/studiogalt/mini/SG_ASL_", "{r}/studiogalt/fbx"
FEW = " ".join(f"{FULL}{x}.usdc" for x in ("C_2_2023_1_30", "D_2_2023_1_30", "E_2_2023_1_31",
      "G_2023_1_31", "I_1_2023_1_31", "Able_2023_2_5", "Abet_2023_2_4"))  # fmt: skip

SAMPLES = f"""
*inspect           inspect {{s}}/characters {{s}}/conversations {{s}}/hands {{s}}/gestures --json
*inspect-text      inspect {OK} {{s}}/characters/ada_hand_right.usdc {{s}}/gestures_ben/ok_01.usdc
 inspect-verbose   inspect -v {{s}}/gestures/wipe_02.usdc
 inspect-quiet     inspect -q {{s}}/gestures
 inspect-wildcard  inspect "{{s}}/gestures/ok_0[12].usdc" --json
 inspect-map       inspect {{m}}/odd_names.usda --map {{m}}/odd.toml --json
 inspect-made      inspect {{m}}/bare.usda {{m}}/two_skeletons.usda {{m}}/two.bvh --json
*reduce            reduce {OK} -o {{o}}/rig.usda --report {{o}}/report.json
 reduce-plots      reduce {OK} -o {{o}}/rig.usdc --plots {{o}}/plots
*reduce-preset-1   reduce {OK} -o {{o}}/rig.usdc --preset 1 --json
 reduce-preset-2   reduce {OK} -o {{o}}/rig.usdc --preset 2 --json
 reduce-preset-3   reduce {OK} -o {{o}}/rig.usdc --preset 3 --json
*reduce-dofs       reduce {TALK}_full.usdc -o {{o}}/rig.usdc --target-dofs 20 --json
*reduce-squares    reduce {TALK}_full.usdc -o {{o}}/rig.usda --fit least-squares --controllers 2 --json
 reduce-dofs-both  reduce {TALK}_full.usdc -o {{o}}/rig.usdc --fit least-squares --target-dofs 12 --json
*reduce-error      reduce {OK} -o {{o}}/rig.usdc --max-error 2 --json
 reduce-error-sq   reduce {OK} -o {{o}}/rig.usdc --max-error 1.5 --fit least-squares --json
 reduce-range      reduce {OK} -o {{o}}/rig.usdc --range 3 --rmsd 0.4 --json
*reduce-several    reduce "{{s}}/gestures/wipe_0[1-3].usdc" -o {{o}}/rigs --json
 reduce-text       reduce "{{s}}/gestures/wipe_0[1-3].usdc" -o {{o}}/rigs -v
*reduce-rig        reduce {{s}}/gestures_ben/ok_01.usdc --rig {{reduce}}/rig.usda -o {{o}}/rig.usda --json
 reduce-left       reduce {OK} -o {{o}}/rig.usdc --side left --json
*reduce-flatten    reduce {{s}}/gestures_ben/ok_02.usdc -o {{o}}/rig.usda --flatten --json
 reduce-package    reduce {OK} -o {{o}}/rig.usdz --json
 reduce-dry        reduce {OK} -o {{o}}/rig.usda -n -v
 reduce-moving     reduce {{s}}/conversations/talk_03_full.usdc -o {{o}}/rig.usdc --json
*expand            expand {{reduce}}/rig.usda -o {{o}}/ok.usda --report {{o}}/report.json
*expand-onto       expand {{reduce}}/rig.usda --onto {{s}}/characters/ben.usdc -o {{o}}/ben.usda --json
 expand-squares    expand {{reduce-squares}}/rig.usda -o {{o}}/talk.usdc --json
 expand-flat       expand {{reduce-flatten}}/rig.usda -o {{o}}/ben.usdc --flatten --json
 expand-package    expand {{reduce-package}}/rig.usdz -o {{o}}/ok.usdz --json
 expand-other      expand {{reduce-rig}}/rig.usda --onto {{s}}/conversations/talk_01_body.usdc -o {{o}}/a.usdc --json
 expand-dry        expand {{reduce}}/rig.usda -n -o {{o}}/ok.usda
 edited            !edit_rig {{reduce}}/rig.usda {{o}}/rig.usda
 expand-edited     expand {{edited}}/rig.usda -o {{o}}/ok.usda --json
*small             library build "{{s}}/gestures/*_0[1-3].usdc" -o {{o}}/lib.usdc --report {{o}}/report.json
 library           library build {{s}}/gestures -o {{o}}/lib.usdc --json
 library-both      library build {{s}}/gestures {{s}}/gestures_ben -o {{o}}/lib.usda --jobs 2
 library-labels    library build "{{s}}/gestures/[ow]*.usdc" -o {{o}}/lib.usdc --labels {{m}}/labels.csv
 library-cutting   library build "{{s}}/gestures/[ow]*.usdc" -o {{o}}/lib.usdc --speed 25 --shortest 0.3 --longest 0.8 --json
 copied            !copy {{library-labels}}/lib.usdc {{o}}/lib.usdc
 library-again     library build "{{s}}/gestures/o*.usdc" "{{s}}/gestures/turn_0[12].usdc" -o {{copied}}/lib.usdc --json
 library-left-out  library build {{s}}/gestures/ok_01.usdc {{m}}/bare.usda {{m}}/text.usda -o {{o}}/lib.usdc
*info              library info {{small}}/lib.usdc --json
 info-text         library info {{library-both}}/lib.usda
*fill              fill {TALK}_body.usdc --library {{small}}/lib.usdc -o {{o}}/talk.usda --alternatives 3 --report {{o}}/report.json
 fill-plots        fill {TALK}_body.usdc --library {{small}}/lib.usdc -o {{o}}/talk.usda --plots {{o}}/plots
 fill-whole        fill {TALK}_body.usdc --library {{library}}/lib.usdc -o {{o}}/talk.usdc --alternatives 2 --json
*fill-paper        fill {TALK}_body.usdc --library {{small}}/lib.usdc -o {{o}}/talk.usdc --preset paper --json
*fill-couple       fill {TALK}_body.usdc --library {{small}}/lib.usdc -o {{o}}/talk.usdc --couple --alternatives 2 --json
*fill-flatten      fill {TALK}_body.usdc --library {{small}}/lib.usdc -o {{o}}/talk.usda --flatten --alternatives 2
 fill-package      fill {TALK}_body.usdc --library {{small}}/lib.usdc -o {{o}}/talk.usdz --alternatives 2 --json
 fill-chordal      fill {TALK}_body.usdc --library {{small}}/lib.usdc -o {{o}}/talk.usdc --metric chordal --k 8 --json
 fill-euler        fill {TALK}_body.usdc --library {{small}}/lib.usdc -o {{o}}/talk.usdc --metric euler --json
 fill-side         fill {TALK}_body.usdc --library {{small}}/lib.usdc -o {{o}}/talk.usdc --side right --json
 fill-kept         fill {TALK}_full.usdc --library {{small}}/lib.usdc -o {{o}}/talk.usdc --json
 fill-replace      fill {TALK}_full.usdc --library {{library}}/lib.usdc -o {{o}}/talk.usdc --replace -v
 fill-own          fill {{s}}/gestures/ok_02.usdc --library {{small}}/lib.usdc -o {{o}}/ok.usdc --replace --json
 fill-ben          fill {{s}}/conversations/talk_03_body.usdc --library {{library-both}}/lib.usda -o {{o}}/talk.usda --json
*fill-add          fill {{m}}/bare.usda --library {{small}}/lib.usdc -o {{o}}/talk.usda --add-fingers --json
 fill-from         fill {{m}}/bare.usda --library {{small}}/lib.usdc -o {{o}}/talk.usdc --fingers-from {{s}}/characters/ben.usdc --json
 fill-from-flat    fill {{m}}/bare.usda --library {{small}}/lib.usdc -o {{o}}/talk.usda --add-fingers --flatten -v
 fill-dry          fill {TALK}_body.usdc --library {{small}}/lib.usdc -o {{o}}/talk.usda -n
*splice            splice {TALK}_body.usdc {{s}}/hands/talk_01_hands_a.usdc {PINS} -o {{o}}/talk.usda --report {{o}}/report.json
 splice-plots      splice {TALK}_body.usdc {{s}}/hands/talk_01_hands_a.usdc {PINS} -o {{o}}/talk.usdc --plots {{o}}/plots -v
*splice-no-pins    splice {TALK}_body.usdc {TALK}_full.usdc -o {{o}}/talk.usdc --json
 splice-unlike     splice {{s}}/gestures/ok_03.usdc {{s}}/gestures_ben/ok_01.usdc -o {{o}}/ok.usdc --json
*splice-trunk      splice {{s}}/gestures/ok_03.usdc {{s}}/gestures/ok_04.usdc --align trunk -o {{o}}/ok.usdc --json
*splice-wrist      splice {{s}}/gestures/ok_03.usdc {{s}}/gestures/ok_04.usdc --wrist hands -o {{o}}/ok.usda --json
 splice-right      splice {TALK}_body.usdc {{s}}/hands/talk_01_hands_right.usdc --pin 391:1 --pin 571:378 --side right -o {{o}}/talk.usdc
 splice-tolerance  splice {TALK}_body.usdc {{s}}/hands/talk_01_hands_b.usdc --pin 196:1:20 --pin left:391:358:40 -o {{o}}/talk.usdc
 splice-band       splice {{s}}/gestures/ok_03.usdc {{s}}/gestures/ok_04.usdc --band 0.4,0.2 -o {{o}}/ok.usdc --json
 splice-flatten    splice {{s}}/gestures/ok_03.usdc {{s}}/gestures/ok_04.usdc --flatten -o {{o}}/ok.usda --json
 splice-package    splice {{s}}/gestures_ben/ok_01.usdc {{s}}/gestures/ok_04.usdc -o {{o}}/ok.usdz --json
 splice-dry        splice {{s}}/gestures/ok_03.usdc {{s}}/gestures/ok_04.usdc -n -o {{o}}/ok.usdc
*evaluate-labels   evaluate {{small}}/lib.usdc --labels-only --json
 evaluate-library  evaluate {{library}}/lib.usdc --labels-only --k 3 --plots {{o}}/plots
*evaluate          evaluate {{small}}/lib.usdc --report {{o}}/report.json
 evaluate-paper    evaluate {{small}}/lib.usdc --preset paper --json
 evaluate-takes    evaluate {{small}}/lib.usdc --takes {{s}}/gestures_ben --metric chordal --json
*compare           compare {TALK}_full.usdc {{fill}}/talk.usda --json
 compare-text      compare {TALK}_full.usdc {{splice}}/talk.usda -v
*compare-align     compare {{s}}/gestures/ok_01.usdc {{s}}/gestures_ben/ok_01.usdc --align --json
 compare-limit     compare {TALK}_full.usdc {{fill}}/talk.usda --max-rms 1 --report {{o}}/report.json
*convert-usda      convert {OK} -o {{o}}/ok.usda
 convert-usdc      convert {OK} -o {{o}}/ok.usdc --json
 convert-usdz      convert {OK} -o {{o}}/ok.usdz --json
*convert-bvh       convert {OK} -o {{o}}/ok.bvh --report {{o}}/report.json
*convert-glb       convert {OK} -o {{o}}/ok.glb --json
 convert-gltf      convert {{s}}/gestures_ben/ok_01.usdc -o {{o}}/ok.gltf
*convert-from-bvh  convert {{convert-bvh}}/ok.bvh -o {{o}}/ok.usda --fps 60 --start 1001 --up Z
*convert-from-glb  convert {{convert-glb}}/ok.glb -o {{o}}/ok.usda --json
 convert-from-gltf convert {{convert-gltf}}/ok.gltf -o {{o}}/ok.bvh --json
 convert-from-usdz convert {{convert-usdz}}/ok.usdz -o {{o}}/ok.glb --json
 convert-units     convert {{convert-bvh}}/ok.bvh -o {{o}}/ok.glb --units m --input-up Z --json
*convert-trim      convert {TALK}_full.usdc -o {{o}}/talk.usda --trim 31:90 --scale 0.5 --json
 convert-fps       convert {TALK}_full.usdc -o {{o}}/talk.usdc --fps 24 --start 101 --up Z --json
 convert-drop      convert {{s}}/conversations/talk_03_full.usdc -o {{o}}/talk.bvh --root-motion drop --up Z
*convert-onto      convert {{s}}/hands/talk_01_hands_a.usdc --onto {{s}}/characters/ben.usdc -o {{o}}/ben.usdc --json
 convert-onto-glb  convert {{s}}/gestures_ben/ok_01.usdc --onto {{s}}/characters/ada.usdc -o {{o}}/ada.glb --json
 convert-onto-body convert {OK} --onto {{s}}/conversations/talk_03_body.usdc -o {{o}}/talk.usda --fps 60 --json
 convert-many      convert {{s}}/gestures_ben --out-dir {{o}}/glb --to glb --json
 convert-bodies    convert {{s}}/conversations {{s}}/characters --out-dir {{o}}/usd
 convert-dry       convert {OK} -o {{o}}/ok.bvh -n
 convert-filled    convert {{fill}}/talk.usda -o {{o}}/talk.usda --start 11 --json
 convert-rig       convert {{reduce}}/rig.usda -o {{o}}/rig.glb --json
*reduce-bvh        reduce {{convert-bvh}}/ok.bvh -o {{o}}/rig.usda --json
 reduce-glb        reduce {{convert-glb}}/ok.glb -o {{o}}/rig.usdc --json
 expand-bvh        expand {{reduce-bvh}}/rig.usda -o {{o}}/ok.usda --json
 fill-bvh          fill {{convert-bvh}}/ok.bvh --library {{small}}/lib.usdc --replace -o {{o}}/ok.usda --json
 fill-glb          fill {{convert-glb}}/ok.glb --library {{small}}/lib.usdc --replace -o {{o}}/ok.usda --flatten --json
 splice-bvh        splice {{convert-bvh}}/ok.bvh {{convert-glb}}/ok.glb -o {{o}}/ok.usda --json
*preview           preview {{fill}}/talk.usda {TALK}_full.usdc --with-report {{fill}}/report.json -o {{o}}/page.html --json
 preview-splice    preview {{splice}}/talk.usda {{s}}/hands/talk_01_hands_a.usdc --with-report {{splice}}/report.json --max-points 0 -o {{o}}/page.html
 preview-figure    preview {{reduce}}/rig.usda --figure {{reduce-plots}}/plots/reduce_errors.svg --title A --max-frames 20 -o {{o}}/page.html
*check             check {{s}}/characters {{s}}/conversations {{s}}/hands {{s}}/gestures_ben --json
*check-results     check {{reduce}}/rig.usda {{expand}}/ok.usda {{fill}}/talk.usda {{splice}}/talk.usda --strict
 check-all         check {{small}}/lib.usdc {{reduce-package}}/rig.usdz {{fill-add}}/talk.usda {{convert-usda}}/ok.usda --json
 check-made        check {{m}}/odd_names.usda {{m}}/two_skeletons.usda {{m}}/late_scale.usda --json
 version           --version
"""  # noqa: E501

REAL = f"""
*real-inspect      inspect {{r}}/maya {{r}}/bvh/performs {{r}}/gltf/webxr-generic-hand {{r}}/fbx/ozz {FULL}Able_2023_2_5.usdc --json
 real-inspect-all  inspect {{r}}/studiogalt/full {{r}}/studiogalt/mini {{r}}/studiogalt/fbx {{r}}/bvh/animated-drawings --json
 real-inspect-text inspect {{r}}/fbx/ozz/walk.fbx {{r}}/bvh/animated-drawings/jesse_dance.bvh {MINI}Able_2023_2_5.usdc
*real-reduce       reduce {FULL}Able_2023_2_5.usdc -o {{o}}/rig.usdc --json
 real-reduce-mini  reduce "{MINI}Ab[aeh]*.usdc" -o {{o}}/rigs --target-dofs 24 --fit least-squares --json
 real-reduce-fbx   reduce {FBX}/SG_ASL_5_2023-1-29_No_Mesh_Full.fbx -o {{o}}/rig.usdc --json
 real-reduce-ozz   reduce {{r}}/fbx/ozz/crossarms.fbx -o {{o}}/rig.usdc --max-error 2 --json
 real-reduce-bvh   reduce {{r}}/bvh/performs/Idle.bvh -o {{o}}/rig.usda --json
*real-expand       expand {{real-reduce}}/rig.usdc --onto {{s}}/characters/ada.usdc -o {{o}}/ada.usdc --json
 real-expand-fbx   expand {{real-reduce-fbx}}/rig.usdc -o {{o}}/fbx.usdc --json
 real-expand-bvh   expand {{real-reduce-bvh}}/rig.usda --onto {{r}}/maya/HIK_Export.usda -o {{o}}/maya.usda --json
*real-few          library build {FEW} -o {{o}}/lib.usdc --json
 real-library      library build {{r}}/studiogalt/full {{r}}/studiogalt/fbx {{r}}/bvh -o {{o}}/lib.usdc --jobs 2 --json
 real-info         library info {{real-library}}/lib.usdc --json
*real-fill-maya    fill {{r}}/maya/HIK_Export.usda --library {{real-few}}/lib.usdc -o {{o}}/maya.usda --alternatives 2 --json
 real-fill-mini    fill {MINI}Ability_1_2023_2_4.usdc --library {{real-library}}/lib.usdc --replace -o {{o}}/mini.usdc --json
 real-fill-paper   fill {FULL}Ability_1_2023_2_4.usdc --library {{real-library}}/lib.usdc --replace --preset paper -o {{o}}/full.usdc --json
 real-fill-bvh     fill {{r}}/bvh/animated-drawings/jesse_dance.bvh --library {{real-few}}/lib.usdc -o {{o}}/jesse.usdc --json
 real-fill-add     fill {{r}}/bvh/animated-drawings/jumping_jacks.bvh --library {{real-few}}/lib.usdc -o {{o}}/jacks.usda --add-fingers --json
 real-fill-wave    fill {{r}}/bvh/animated-drawings/wave_hello.bvh --library {{real-few}}/lib.usdc -o {{o}}/wave.usdc --fingers-from {{s}}/characters/ada.usdc --json
 real-fill-fbx     fill {{r}}/fbx/ozz/walk.fbx --library {{real-few}}/lib.usdc -o {{o}}/walk.usdc --replace --json
*real-splice       splice {FULL}Able_2023_2_5.usdc {MINI}Able_2023_2_5.usdc -o {{o}}/able.usdc --json
 real-splice-fbx   splice {FULL}5_2023_1_29.usdc {FBX}/SG_ASL_5_2023-1-29_No_Mesh_Mini.fbx --wrist hands -o {{o}}/five.usdc --json
 real-splice-over  splice {FBX}/SG_ASL_2_2023-1-28_No_Mesh_Full.fbx {MINI}2_2023_1_28.usdc --align trunk -o {{o}}/two.usda --json
 real-evaluate     evaluate {{real-few}}/lib.usdc --json
 real-compare      compare {FULL}Able_2023_2_5.usdc {MINI}Able_2023_2_5.usdc --align --json
 real-compare-fbx  compare {FULL}5_2023_1_29.usdc {FBX}/SG_ASL_5_2023-1-29_No_Mesh_Full.fbx -v
*real-convert      convert {{r}}/fbx/ozz {{r}}/gltf/webxr-generic-hand {{r}}/bvh/performs --out-dir {{o}}/usd --json
 real-convert-bvh  convert {{r}}/fbx/ozz/walk.fbx {FBX}/SG_ASL_2_2023-1-28_No_Mesh_Full.fbx {{r}}/maya/HIK_Export.usda --out-dir {{o}}/bvh --to bvh
 real-convert-glb  convert {{r}}/bvh/animated-drawings {{r}}/maya/HIK_Export.usda --out-dir {{o}}/glb --to glb --json
 real-convert-onto convert {FULL}Able_2023_2_5.usdc --onto {{r}}/maya/HIK_Export.usda -o {{o}}/maya.usda --fps 30 --json
 real-onto-fbx     convert {FULL}Able_2023_2_5.usdc --onto {{r}}/fbx/ozz/walk.fbx -o {{o}}/walk.usdc --json
 real-convert-keep convert {FULL}Able_2023_2_5.usdc -o {{o}}/able.usda --scale 2 --up Z --start 1 --json
*real-preview      preview {FULL}Able_2023_2_5.usdc {MINI}Able_2023_2_5.usdc {{r}}/fbx/ozz/walk.fbx -o {{o}}/page.html --json
*real-check        check {{r}}/maya {FULL}Able_2023_2_5.usdc {MINI}Able_2023_2_5.usdc --json
 real-check-fill   check {{real-fill-maya}}/maya.usda {{real-splice}}/able.usdc {{real-reduce}}/rig.usdc --json
"""  # noqa: E501

# Verbs on inputs of the kinds that people have instead of good ones: code and message.
BAD_FILES = (
    "nowhere.usdc", "text.usda", "empty.usdc", "cut.usdc", "cut.bvh", "cut.glb", "cut.fbx",
    "suffix.mov", "no_skeleton.usda", "no_hand.usda", "two_skeletons.usda", "two_hands.usda",
    "not_a_number.usda", "zero.usda",
)  # fmt: skip
BAD_VERBS = {
    "inspect": "inspect {file} --json",
    "reduce": "reduce {file} -o {{o}}/rig.usda",
    "convert": "convert {file} -o {{o}}/out.bvh",
    "splice": f"splice {{file}} {OK.replace('{', '{{').replace('}', '}}')} -o {{{{o}}}}/out.usda",
    "check": "check {file}",
}
BAD = f"""
 bad-preset        reduce {OK} -o {{o}}/rig.usda --preset 9
 bad-limits        reduce {OK} -o {{o}}/rig.usda --preset 1 --target-dofs 4
 bad-controllers   reduce {OK} -o {{o}}/rig.usda --controllers 2
 bad-error         reduce {OK} -o {{o}}/rig.usda --max-error -1
 bad-suffix        reduce {OK} -o {{o}}/rig.bvh
 bad-exists        reduce {OK} -o {{reduce}}/rig.usda
 bad-over-input    reduce {{reduce}}/rig.usda -o {{reduce}}/rig.usda --force
 bad-no-rig        reduce {OK} --rig {OK} -o {{o}}/rig.usda
 bad-wildcard      reduce "{{s}}/gestures/none_*.usdc" -o {{o}}/rig.usda
 bad-skel          reduce {OK} --skel Nobody -o {{o}}/rig.usda
 bad-map           inspect {OK} --map {{m}}/wrong.toml
 bad-map-file      inspect {OK} --map {{m}}/nowhere.toml
 bad-expand        expand {OK} -o {{o}}/ok.usda
 bad-expand-onto   expand {{reduce}}/rig.usda --onto {{m}}/no_hand.usda -o {{o}}/ok.usda
 bad-library       fill {TALK}_body.usdc --library {OK} -o {{o}}/talk.usda
 bad-library-text  library info {{m}}/text.usda
 bad-library-none  library build {{m}}/bare.usda {{m}}/no_hand.usda -o {{o}}/lib.usdc
 bad-library-over  library build {OK} -o {{reduce}}/rig.usda
 bad-labels        library build {OK} -o {{o}}/lib.usdc --labels {{m}}/wrong.csv
 bad-speed         library build {OK} -o {{o}}/lib.usdc --speed -3
 bad-fill-bare     fill {{m}}/bare.usda --library {{small}}/lib.usdc -o {{o}}/talk.usda
 bad-fill-hands    fill {{s}}/characters/ada_hands.usdc --library {{small}}/lib.usdc -o {{o}}/a.usda
 bad-metric        fill {TALK}_body.usdc --library {{small}}/lib.usdc --metric none -o {{o}}/talk.usda
 bad-no-fingers    fill {{m}}/bare.usda --library {{small}}/lib.usdc --fingers-from {{m}}/bare.usda -o {{o}}/t.usda
 bad-splice-length splice {TALK}_body.usdc {OK} -o {{o}}/talk.usda
 bad-splice-pin    splice {{s}}/gestures/ok_03.usdc {{s}}/gestures/ok_04.usdc --pin 5 -o {{o}}/ok.usda
 bad-splice-pins   splice {{s}}/gestures/ok_03.usdc {{s}}/gestures/ok_04.usdc --pin 5:30 --pin 30:5 -o {{o}}/ok.usda
 bad-splice-far    splice {{s}}/gestures/ok_03.usdc {{s}}/gestures/ok_04.usdc --pin 5:3000 -o {{o}}/ok.usda
 bad-splice-band   splice {{s}}/gestures/ok_03.usdc {{s}}/gestures/ok_04.usdc --band 2 -o {{o}}/ok.usda
 bad-splice-still  splice {{s}}/gestures/ok_03.usdc {TALK}_body.usdc -o {{o}}/ok.usda
 bad-evaluate      evaluate {OK}
 bad-evaluate-one  evaluate {{one}}/lib.usdc
 bad-compare       compare {OK} {{m}}/no_hand.usda
 bad-convert-two   convert {{s}}/gestures -o {{o}}/all.bvh
 bad-convert-none  convert {OK}
 bad-convert-trim  convert {OK} -o {{o}}/ok.bvh --trim 5
 bad-convert-empty convert {OK} -o {{o}}/ok.bvh --trim 500:600
 bad-convert-fps   convert {OK} -o {{o}}/ok.bvh --fps -2
 bad-convert-units convert {OK} -o {{o}}/ok.bvh --units m
 bad-convert-skel  convert {OK} -o {{o}}/ok.bvh --onto-skel Nobody
 bad-convert-some  convert {OK} {{m}}/text.usda {{m}}/no_skeleton.usda --out-dir {{o}}/out --to bvh
 bad-animation     convert {{convert-glb}}/ok.glb -o {{o}}/ok.usda --animation none
 bad-preview       preview {{m}}/text.usda -o {{o}}/page.html
 bad-preview-of    preview {OK} --with-report {{fill}}/report.json -o {{o}}/page.html
 bad-preview-file  preview {OK} --figure {{m}}/labels.csv -o {{o}}/page.html
 bad-verb          remove {OK}
 bad-option        inspect {OK} --colour
"""  # noqa: E501

# Results that were wrong before and are mended: they differ, and that is meant.
MENDED = {
    "signs": "FBX with other axis signs, written over, was turned by 180 degrees",
    "sides": "FBX with one other axis sign, written over, had its fingers mirrored",
    "roots": "of a BVH with two ROOTs and --skel the result could not be read back",
    "mirrored": "--add-fingers below a mirrored wrist gave matrices with determinant -1",
    "late": "one sample of a constant attribute far away stretched the clip",
    "codes": "time codes at 29.97 frames a second were not whole where they could be",
    "bad-check-two_hands.usda": "names in a warning came in another order in every run",
}
NAMED = f"""
 signs-reduce      reduce {{m}}/signs.fbx -o {{o}}/rig.usda --json
 signs-fill        fill {{m}}/signs.fbx --library {{small}}/lib.usdc --replace -o {{o}}/out.usda --json
 signs-splice      splice {{m}}/signs.fbx {OK} -o {{o}}/out.usda --json
 signs-compare     compare {{m}}/signs.fbx {{signs-splice}}/out.usda --json
 sides-reduce      reduce {{m}}/sides.fbx -o {{o}}/rig.usda --json
 sides-splice      splice {{m}}/sides.fbx {OK} -o {{o}}/out.usda --json
 roots-reduce      reduce {{m}}/two.bvh --skel Second -o {{o}}/rig.usda
 roots-expand      expand {{roots-reduce}}/rig.usda -o {{o}}/out.usda
 roots-inspect     inspect {{roots-reduce}}/rig.usda --json
 mirrored-fill     fill {{m}}/mirrored.usda --library {{small}}/lib.usdc --add-fingers -o {{o}}/out.usda --json
 late-inspect      inspect {{m}}/late_scale.usda --json
 late-convert      convert {{m}}/late_scale.usda -o {{o}}/out.bvh --json
 codes-convert     convert {OK} -o {{o}}/ok.usda --fps 29.97 --start 1003 --json
 codes-trim        convert {{codes-convert}}/ok.usda -o {{o}}/ok.usda --trim 1010:1020 --json
"""  # noqa: E501
ONE = f" one library build {OK} -o {{o}}/lib.usdc\n"


@dataclass(frozen=True)
class Step:
    """A command with a name, by which others may use what it writes."""

    name: str
    command: str
    quick: bool = False

    @property
    def group(self) -> str:
        """The row of the table that it counts for."""
        word = self.command.split()[0]
        return "bad inputs" if self.name.startswith("bad-") else word.strip("-")

    @property
    def mended(self) -> str:
        """The wrong result that it shows, if it is one that is to differ."""
        return MENDED.get(self.name, MENDED.get(self.name.partition("-")[0], ""))

    @property
    def needs(self) -> set[str]:
        """Names in braces: of other steps, and the folders of inputs."""
        return set(re.findall(r"{([\w-]+)}", self.command))


def all_steps(real: bool) -> list[Step]:
    """All steps in an order in which they can run."""
    bad = "".join(
        f"{'*' if verb == 'inspect' else ' '}bad-{verb}-{file} {text.format(file='{m}/' + file)}\n"
        for file in BAD_FILES
        for verb, text in BAD_VERBS.items()
    )
    lines = (SAMPLES + ONE + bad + BAD + NAMED + (REAL if real else "")).splitlines()
    return [Step(*line[1:].split(maxsplit=1), line[0] == "*") for line in lines if line.strip()]


def chosen(steps: Iterable[Step], verbs: Iterable[str], quick: bool) -> list[Step]:
    """Steps of these verbs (of all if there are none), and those that they need."""
    steps, verbs = list(steps), set(verbs)
    wanted = {s.name for s in steps
              if (not verbs or s.group.split()[0] in verbs) and (s.quick or not quick)}  # fmt: skip
    for step in reversed(steps):
        if step.name in wanted:
            wanted |= step.needs
    return [s for s in steps if s.name in wanted]
