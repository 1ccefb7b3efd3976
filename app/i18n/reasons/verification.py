"""Holds the sentences about findings of the verifier and about preconditions, by reason code."""

from collections.abc import Mapping

from app.i18n.catalogues import N_

SENTENCES: Mapping[str, str] = {
    "picture_does_not_show_it": N_("{name} is not in the picture: neither detector nor text reader finds it"),
    "picture_not_read": N_("The picture was not read by the harness"),
    "picture_shows_it": N_("The picture shows {name} (score {score:.2f})"),
    "picture_shows_it_doubtfully": N_("The picture may show {name}: score {score:.2f}, at least {least:.2f} is needed"),
    "reading_of_another_picture": N_("The reading is of another picture ({image})"),
    "all_conditions_hold": N_("All {count} conditions hold."),
    "another_sound_played": N_("another sound was played"),
    "arrived": N_("{distance_m:.2f} m from the target in {samples} samples, at rest"),
    "away_from_place": N_("{distance_m:.2f} m from the place"),
    "blob_checksum_wrong": N_("blob {blob} does not match its checksum"),
    "blob_of_another_kind": N_("blob {blob} is no {kind}: {error}"),
    "blob_unreadable": N_("blob {blob} cannot be read: {error}"),
    "body_moved_before_capture": N_("the body moved {moved_m:.3f} m or turned {turned_rad:.3f} rad before a capture"),
    "body_moved_by_odometry": N_("the body moved {moved_m:.3f} m in {window_s:g} s by odometry"),
    "body_moved_during_look": N_("the body moved {moved_m:.3f} m and turned {turned_rad:.3f} rad during the look"),
    "body_moved_in_last_second": N_("the body moved {moved_m:.3f} m in the last second"),
    "chain_belongs_together": N_("transcript, frames, analysis and delivery belong together"),
    "channel_acknowledged": N_("the channel acknowledged {images} images and the text"),
    "circle_not_covered": N_("headings {narrowest_rad:.2f} to {widest_rad:.2f} rad apart do not cover the circle"),
    "circuit_completed": N_("departed, {share:.1%} of the route in order, and back"),
    "condition_without_argument": N_("the condition does not say {name}: {error}"),
    "condition_without_image_count": N_("the condition does not say how many images: {error}"),
    "context_lacks": N_("the context holds no {kind:word}"),
    "effect_not_testable": N_("{predicate} cannot test such an effect"),
    "facts_of_unaccepted_nodes": N_("facts of stages that were not accepted: {nodes}"),
    "finding_reported": N_("the finding was delivered in words, and a report was spoken after it"),
    "findings_in_pictures": N_("{findings} findings in {pictures} pictures, {wanted} wanted"),
    "findings_in_unaccepted_pictures": N_("{findings} findings are in pictures that were not accepted"),
    "frame_of_another_size": N_("a frame is {width_px}x{height_px}, not {wanted_width_px}x{wanted_height_px}"),
    "frames_before_turn_ended": N_("{frames} frames were taken before their turn ended"),
    "frames_not_of_execution": N_("{frames} frames were not taken during the execution"),
    "frames_without_rotation": N_("{frames} frames have no rotation receipt of their own"),
    "fresh_pose_in_map": N_("a fresh pose in the robot's map"),
    "gap_without_look": N_("{gap_s:.2f} s without a look, bound {bound_s:.2f} s"),
    "goal_not_in_context": N_("the goal is not in the context"),
    "hardware_stop_is_engaged": N_("the hardware stop is engaged"),
    "hardware_stop_is_released": N_("the hardware stop is released"),
    "headings_apart": N_(
        "localiser and odometry saw turns that differ by {apart_rad:.2f} rad, at most {bound_rad:.2f} rad are allowed"
    ),
    "held_at_looks": N_("held at {held} of {looks} looks in {interval_s:g} s"),
    "image_not_of_panorama": N_("an image is not of the accepted panorama"),
    "image_copies_earlier": N_("image {image} is a copy of {earlier}, which was taken for an earlier capture"),
    "image_of_earlier_capture": N_("the bytes of image {image} were recorded before, for request {request}"),
    "image_unreadable": N_("image {image} could not be decoded: {problem}"),
    "image_chunks_damaged": N_("a part of it is missing or does not match its checksum"),
    "image_of_other_size_than_decoded": N_("its size is another than when it was decoded"),
    "image_not_whole": N_("image {image} cannot be decoded to its end ({error})"),
    "image_rows_missing": N_("rows are missing"),
    "image_of_another_capture": N_("image {image} is labelled for another request or another time than its capture"),
    "image_of_another_heading": N_("image {image} is labelled {off_rad:.2f} rad beside the heading that was measured"),
    "image_too_large": N_("an image claims {width_px} by {height_px} pixels"),
    "images_are_copies": N_("images {image} and {other} of different headings show one picture"),
    "images_not_of_whole": N_("{images} {what:word} images are not of the {whole:word}"),
    "images_too_small": N_("{images} images are below {width_px}x{height_px}"),
    "images_whole": N_("{images} whole images, the body at rest"),
    "imu_accounts_for_motion": N_("the IMU alone accounts for {moved_m:.3f} m in {window_s:g} s"),
    "imu_cannot_tell_rest": N_("an IMU alone cannot tell standing still from steady motion"),
    "in_their_order": N_("{nodes} stages ended in their order"),
    "inertia_shows_no_speed": N_(
        "odometry gained or lost {claimed_mps:.2f} m/s where the IMU shows {shown_mps:.2f} m/s"
    ),
    "inertia_shows_no_turn": N_("odometry turned {claimed_rad:.2f} rad where the IMU shows {shown_rad:.2f} rad"),
    "items_of_elsewhere": N_("{items} items are of elsewhere"),
    "items_unacknowledged": N_("{items} items have no acknowledgement"),
    "journal_holds_no_start": N_("the robot's own journal holds no start of this request"),
    "jpeg_cut_short": N_("the JPEG is cut short"),
    "jpeg_without_header": N_("the JPEG has no frame header"),
    "localiser_and_odometry_apart": N_("localiser and odometry differ by {disagreement_m:.2f} m"),
    "mandatory_evidence_missing": N_("mandatory evidence is missing: {names}"),
    "names_no_image": N_("{stages} names no image"),
    "neither_jpeg_nor_png": N_("the blob is neither JPEG nor PNG"),
    "newest_sample_too_old": N_("the newest sample is {age_s:.2f} s old, limit {limit_s:.2f} s"),
    "no_accepted_fact": N_("no accepted fact {name} is known"),
    "no_accepted_fact_of_stage": N_("no accepted fact {name} of {stage} is known"),
    "no_analysis_receipt": N_("no analysis receipt names a report"),
    "no_captured_frame": N_("no frame with a capture receipt is among the evidence"),
    "no_captured_image": N_("no image with a capture receipt is among the evidence"),
    "no_delivery_receipt": N_("no delivery receipt is among the evidence"),
    "no_departure": N_("no departure beyond {departure_m:.2f} m was measured in {samples} samples"),
    "no_fresh_odometry": N_("no fresh odometry shows whether the body moves"),
    "no_fresh_pose": N_("no fresh pose from the localiser"),
    "no_heading_by_odometry": N_("no odometry shows the heading at {at_s:.2f}"),
    "no_odometry_during_look": N_("no odometry shows whether the body stood"),
    "no_odometry_in_motion": N_("no odometry in motion confirms the localiser"),
    "no_picture_report": N_("no receipt names a report about a picture"),
    "no_playback_receipt": N_("no playback receipt names a sound"),
    "no_pose_in_route_map": N_("no pose of the route's frame and map was received"),
    "no_pose_in_target_map": N_("no pose of the target's frame and map was received in this execution"),
    "no_target": N_(
        "the recording names no target: give one with --target X,Y or --place, "
        "or name its goal topic with --topic goal=NAME"
    ),
    "no_predicate": N_("no predicate tests {predicate}"),
    "no_samples_of_execution": N_("no samples of this execution are known"),
    "no_transcript_receipt": N_("no transcript receipt names a text"),
    "no_wav": N_("the blob is no WAV"),
    "picture_read_back": N_("the picture {image} was read back from the archive"),
    "stages_not_accepted": N_("not accepted: {stages}"),
    "not_accepted_yet": N_("not accepted yet: {stages}"),
    "not_at_look": N_("{held}; {ago_s:.2f} s before the end: {reason}"),
    "not_one_image": N_("{images} images are named, not one"),
    "not_one_text_delivered": N_("{texts} texts were delivered, not one"),
    "nothing_measures_subject": N_("nothing measures where {subject} is"),
    "nothing_shows_whether_body_moves": N_("no source outside the localiser shows whether the body moves"),
    "nothing_tested": N_("no condition was tested"),
    "odometry_does_not_cover": N_("odometry does not cover the {window_s:g} s before {until_s:.2f}"),
    "odometry_shorter_than_second": N_("odometry shows less than a second"),
    "odometry_shorter_than_window": N_("odometry shows less than a window of {window_s:g} s"),
    "of_another_mission": N_("of another mission: {nodes}"),
    "of_condition": N_("{condition}: {reason}"),
    "out_of_order": N_("{later} did not end and count after {earlier}"),
    "panorama_whole": N_("{frames} whole frames around the circle, the body at rest at each"),
    "pictures_do_not_hold_box": N_("{pictures} pictures are too small or do not hold their finding's box"),
    "place_belies_fact": N_("{away}; the accepted fact {condition} no longer holds"),
    "planner_declares_too_little": N_("the planner itself declares {share:.1%} of the route"),
    "playback_after_receipt": N_("the playback ended after its receipt was collected"),
    "playback_of_another_node": N_("the playback does not belong to the reporting stage"),
    "png_cut_short": N_("the PNG is cut short"),
    "pose_and_status_on_different_maps": N_("pose and status name different maps"),
    "poses_at_edge": N_("{inside} of {poses} poses lie inside {region}: the body is at its edge"),
    "poses_inside": N_("{poses} poses lie inside {region}"),
    "poses_outside": N_("none of {poses} poses lies inside {region}"),
    "poses_stopped": N_("no pose arrived in the last {silent_s:.1f} s, while other sensors went on"),
    "precondition_names_no_place": N_("the precondition names no place"),
    "predicate_failed": N_("the predicate {predicate} failed: {kind}: {error}"),
    "providers_word_alone": N_("{reason} (single source: declared by the provider)"),
    "ran_too_fast": N_("the body ran at {speed_mps:.2f} m/s, the cap is {cap_mps:.2f} m/s"),
    "receipts_repeated": N_("{receipts} receipts came twice"),
    "receipts_without_request": N_("{receipts} receipts answer no request of this mission"),
    "record_unreadable": N_("the record {kind:word} cannot be read: {error}"),
    "report_before_analysis": N_("the report was spoken before the analysis"),
    "report_cites_foreign_images": N_("it cites {images} images that are not of the accepted panorama"),
    "report_covers_frames": N_("the report covers the {frames} accepted frames and no other"),
    "report_leaves_out_frames": N_("it leaves out {missing} of {frames} accepted frames"),
    "report_of_accepted_picture": N_("the report is about the accepted picture {image}"),
    "report_of_another_picture": N_("it is about {image}, not the accepted picture"),
    "report_of_another_size": N_(
        "it says {width_px}x{height_px} pixels, the picture has {picture_width_px}x{picture_height_px}"
    ),
    "report_verdict_does_not_follow": N_("its verdict does not follow from its findings"),
    "rests_on_declared": N_("it rests on {stages:words}, which is declared and not verified: {reason}"),
    "odometry_walked_less": N_(
        "sources disagree: odometry shows {shown_m:.2f} m of way, the poses show {claimed_m:.2f} m of the route"
    ),
    "returned_before_departure": N_("the return was measured before the departure"),
    "robot_says_not_localised": N_("the robot says that it is not localised"),
    "route_not_covered": N_("{share:.1%} of the route was measured, bound {bound:.0%}"),
    "samples_do_not_cover": N_("the samples do not cover the {interval_s:g} s before {until_s:.2f}"),
    "samples_not_consumed": N_("{consumed:.0f} of {samples} samples were consumed"),
    "samples_on_both_sides": N_("the {samples} newest samples fall on both sides of the bound: {furthest}"),
    "single_pose_source": N_("{why} (single source: {source}, nothing else confirms it)"),
    "sound_over_too_soon": N_("{sounds_s:.2f} s of sound were over after {lasted_s:.2f} s"),
    "sound_played": N_("all {samples} samples were consumed in {lasted_s:.1f} s of mission time"),
    "sound_without_samples": N_("the sound has no samples"),
    "sources_disagree": N_(
        "sources disagree: the displacements of localiser and odometry differ by {disagreement_m:.2f} m, "
        "bound {bound_m:.2f} m"
    ),
    "stages_share_image": N_("{stages} stages share the image {image}"),
    "status_unknown_or_old": N_("the robot's status is unknown or old"),
    "text_does_not_name_finding": N_("the delivered text does not name the finding"),
    "too_far_from_target": N_("{distance_m:.2f} m from the target, bound {bound_m:.2f} m"),
    "too_few_frames": N_("{frames} of {wanted} frames"),
    "too_few_fresh_poses": N_("fewer than {samples} fresh poses"),
    "too_few_images": N_("{images} of {wanted} images"),
    "too_few_images_delivered": N_("{images} of {wanted} analysed images were delivered"),
    "too_few_independent_sources": N_(
        "single source ({sources:words}): independence {level}, required {required}; {reason}"
    ),
    "too_few_poses_in_frame": N_("{poses} of {wanted} poses in the region's frame and map"),
    "too_few_samples": N_("{samples} of {wanted} samples with distinct sensor times"),
    "transcript_not_of_goal": N_("the transcript's checksum {checksum} is not that of the goal"),
    "transcript_of_another_goal": N_("the transcript is not of this goal"),
    "transcript_of_goal": N_("the transcript's checksum {checksum} is that of the goal"),
    "verifier_did_not_answer": N_("the verifier did not answer: {kind}: {error}"),
    "faces_elsewhere": N_(
        "the body is turned {off_deg:.1f}° away from the heading, at most {bound_deg:.1f}° allowed; {percent:.0f} % of "
        "the lidar sweep lie on the walls"
    ),
    "faces_heading": N_(
        "turned within {off_deg:.1f}° of the heading; {percent:.0f} % of the lidar sweep lie on the walls"
    ),
    "sweep_fits_no_heading": N_("the lidar sweep fits no heading clearly: at best {percent:.0f} % of it lie on walls"),
    "floor_not_seen": N_(
        "{percent:.0f} % of the floor that can be reached was seen, {wanted:.0f} % wanted: {unseen_m2:.1f} m² were not "
        "seen, {seen_m2:.1f} m² were; {closed_m2:.1f} m² are closed off"
    ),
    "floor_seen": N_(
        "{percent:.0f} % of the floor that can be reached was seen ({seen_m2:.1f} m²); {unseen_m2:.1f} m² of it were "
        "not, and {closed_m2:.1f} m² are closed off"
    ),
    "views_apart": N_("{views} views from places {apart_m:g} m apart or more, {wanted:g} wanted"),
    "was_in_closed_region": N_("the body was in {region}, which is closed to it"),
    "wav_without_sound": N_("the WAV has no complete sound"),
    "waypoints_missed": N_("{passed} of {of} waypoints were passed in order"),
    "another_text_stored": N_("the channel holds another text than the one to be sent"),
    "camera_and_lidar_disagree": N_(
        "camera and lidar disagree: {camera_share:.0%} of the passage's width is obstructed by the images, "
        "{lidar_share:.0%} by the lidar; bound {bound:.0%}"
    ),
    "findings_not_in_sight": N_(
        "{findings} findings are out of view, range or line of sight in the images that are to show them"
    ),
    "inertia_fell_silent": N_(
        "odometry shows a change of motion at {at_s:.1f} s, and inertia, which is to be felt, is missing there "
        "({samples} samples in all)"
    ),
    "picture_of_another_heading": N_(
        "picture {image} fits the lidar sweep better {turn_deg:+.0f}° beside the claimed heading ({other:.1f}) than "
        "there ({own:.1f})"
    ),
    "pictures_fit_no_heading": N_(
        "the pictures do not clearly fit the lidar sweep at the claimed headings: {own:.1f} there, {other:.1f} "
        "{turn_deg:+.0f}° beside them"
    ),
    "pictures_not_laid_over_sweep": N_("the pictures cannot be laid over the lidar sweep"),
    "pictures_of_other_headings": N_(
        "{pictures} pictures fit the lidar sweeps better {turn_deg:+.0f}° beside the claimed headings ({other:.1f}) "
        "than there ({own:.1f})"
    ),
    "findings_outside_passage": N_("{findings} findings are not in the passage"),
    "frames_without_heading": N_("no measured heading of the frames is known"),
    "message_changed": N_("the message was changed after it was accepted"),
    "message_not_found": N_("the channel holds no such message"),
    "message_not_read_back": N_("the message was not read back from the channel"),
    "message_of_another_channel": N_("the message was read from {channel}, not from {asked}"),
    "message_of_another_request": N_("the message read back is of another request"),
    "message_read_back": N_("read back from the channel: the text and {images} images"),
    "no_camera_model": N_("the robot does not describe its camera"),
    "no_lidar_sweep": N_("no lidar sweep of the passage is among the evidence"),
    "no_odometry_with_sweep": N_("no odometry shows whether the body stood during the sweep"),
    "no_pose_with_sweep": N_("no pose says from where the lidar swept"),
    "no_request_record": N_("no record of the request is known"),
    "no_sweep_at_rest": N_("no lidar sweep was taken after the body came to rest"),
    "passage_checked_by_lidar": N_(
        "images and lidar agree: {camera_share:.0%} of the passage's width is obstructed by the images, "
        "{lidar_share:.0%} by the lidar"
    ),
    "passage_not_in_view": N_(
        "the images show {seen:.0%} of the passage's floor, {wanted:.0%} wanted: floor that was not seen is not clear"
    ),
    "passage_not_swept": N_("the lidar sees {seen:.0%} of the passage's floor, {wanted:.0%} wanted"),
    "read_path_failed": N_("the channel could not be read back: {problem}"),
    "report_of_another_passage": N_("the report is about another passage"),
    "request_differs_from_record": N_("the request differs from the record of what was submitted"),
    "request_recorded": N_("{requested_by} submitted it, channel {channel}"),
    "request_spoken": N_("{requested_by} spoke it, channel {channel}; written down by {recogniser}"),
    "stored_images_of_elsewhere": N_("{images} stored images are not of the analysis"),
    "sweep_cut_short": N_("a lidar sweep is cut short: {points} points in {bytes} bytes"),
    "sweep_from_elsewhere": N_(
        "the lidar swept {apart_m:.2f} m from where the images were taken; bound {bound_m:.2f} m"
    ),
    "sweep_of_another_map": N_("the lidar sweep is of map {map_version}"),
    "sweep_of_another_time": N_("{sweeps} lidar sweeps are of another time"),
    "too_few_images_stored": N_("the channel holds {images} of {wanted} images"),
    "another_place_heard": N_("the report was not heard to name {place}"),
    "contrary_heard": N_("what was heard contradicts the finding: {heard}"),
    "finding_not_heard": N_("what was heard does not state the finding: {heard}"),
    "no_room_recording": N_("the report was synthesised and checked, not played: no microphone recorded the room"),
    "recording_of_earlier_playback": N_(
        "the recording of the room is one of an earlier playback, for request {request}, or a copy of it"
    ),
    "recognition_of_another_sound": N_("the recognition is of another recording"),
    "another_outcome_asked": N_("the harness asked for another report than this one"),
    "other_words_heard": N_("words were heard that were not to be said: {words}"),
    "outcome_denied": N_("what was heard denies what was to be reported: {heard}"),
    "recording_at_another_speed": N_(
        "the recording runs {speed:.3f} times as fast as what was played: it is no recording of this playback"
    ),
    "recording_silent": N_("the microphone recorded nothing but silence"),
    "report_heard": N_("heard in the room: {heard}"),
    "report_heard_before_outcome": N_("the report was heard before all that it tells was accepted"),
    "report_heard_before_analysis": N_("the report was heard before the analysis"),
    "speech_not_recognised": N_("what was recorded could not be recognised"),
    "unverified_part_not_heard": N_("the report was not heard to call this part unverified: {part}"),
    "unknown_words": N_("the recogniser does not know {words}"),
    "words_not_heard": N_("not heard: {words}"),
}
